"""The worker's side of the protocol: a program with a model serves its tasks by this one file.

It runs under Python 3.9 or later with NumPy and the standard library and imports nothing else of this
library, so that a program of one's own may have a copy of it beside itself:

    from serving import Answer, file_digest, serve

    def depth(request, progress):
        photographs = [request.array(name) for name in sorted(request.files)]
        ...
        return Answer("My model 1.0", file_digest("weights.pt"), {"depth_000": depth})

    serve({"depth": depth})

Run, it then reads a line of JSON a request from its standard input, ``{"request": FOLDER, "response": FOLDER}``;
with ``--http PORT --token-file FILE`` it answers on this machine's loopback.
A request is a folder with ``request.json`` {protocol, task, backend, parameters, inputs: name -> {file, sha256}};
a response one with ``response.json`` {protocol, task, backend, weights, values, outputs: name -> {file, sha256,
and of an array dtype, shape}, seconds}, or {protocol, task, error: {kind, what, cure}}, written last. Progress is told
as lines of JSON {done, total, text}.
"""

from __future__ import annotations

import argparse
import hashlib
import hmac
import json
import os
import re
import shutil
import socketserver
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler
from io import BufferedIOBase
from pathlib import Path
from typing import Any

import numpy as np

PROTOCOL = 1
"""Version of requests and responses; both sides have to name it."""
REQUEST_FILE, RESPONSE_FILE = "request.json", "response.json"
RANDOM = "random"
"""What stands for the digest of the weights where they are random: no such response is ever taken for a model's."""
TOKEN_VARIABLE = "R2SEGO_WORKER_TOKEN"
LEAST_TOKEN, MOST_BYTES, MOST_FILES = 16, 4 << 30, 10_000

_PLAIN = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}(/[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}){0,2}")
_MOST_LINE, _PIECE = 4 << 20, 1 << 20
_MOST_TOLD = 300
_HOSTS = ("127.0.0.1", "localhost")
_STALLED_S = 30.0


class UnusableError(Exception):
    """What this environment lacks to answer anything, in words for the person, and what helps."""

    def __init__(self, what: str, cure: str = "") -> None:
        super().__init__(what)
        self.cure = cure


class RefusedError(Exception):
    """Why this one request is not answered; the next may be."""


class Request:
    """What is asked: ``parameters``, JSON's values by name, and ``files``, the place of each input by name.

    Files of the answer may be written into ``folder``.
    """

    def __init__(
        self, task: str, backend: str, parameters: dict[str, Any], files: dict[str, Path], folder: Path
    ) -> None:
        self.task, self.backend, self.parameters, self.files, self.folder = task, backend, parameters, files, folder

    def array(self, name: str) -> np.ndarray:
        """The input ``name`` as the array that it holds."""
        return np.load(self.files[name], allow_pickle=False)  # type: ignore[no-any-return]


class Answer:
    """What a task gives: the ``backend`` with its version, the SHA-256 of its weights, and its outputs by name.

    ``weights`` is ``file_digest`` of what was loaded, ``RANDOM`` where nothing was, or "" for what has no weights.
    ``outputs``: arrays, or files, which are moved; ``values``: JSON's values, such as scores.
    """

    def __init__(
        self,
        backend: str,
        weights: str,
        outputs: Mapping[str, np.ndarray | Path],
        values: Mapping[str, Any] | None = None,
    ) -> None:
        self.backend, self.weights, self.outputs, self.values = backend, weights, outputs, dict(values or {})


Tell = Callable[..., None]
"""``progress(done, total, text="")``, in whole numbers of any unit."""
Task = Callable[[Request, Tell], Answer]


def serve(tasks: Mapping[str, Task]) -> None:
    """Answer requests for ``tasks`` as the command line says, until standard input ends."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--http", type=int, metavar="PORT", help="answer on 127.0.0.1, not on standard input")
    parser.add_argument("--token-file", type=Path, help=f"else ${TOKEN_VARIABLE} has the token")
    options, _ = parser.parse_known_args()
    if options.http is None:
        _serve_lines(tasks)
    else:
        with _Server(options.http, _token(options.token_file), tasks) as server:
            print(json.dumps({"port": server.server_address[1]}), flush=True)
            server.serve_forever()


def answer(request_folder: Path, response_folder: Path, tasks: Mapping[str, Task], tell: Tell) -> None:
    """Answer one request; whatever happens becomes ``response.json``, but for a kill."""
    began_s, task = time.monotonic(), ""
    try:
        request = read_request(request_folder, response_folder)
        task = request.task
        if task not in tasks:
            raise UnusableError(f"it serves {', '.join(sorted(tasks))}, not {task}")
        write_answer(response_folder, task, tasks[task](request, tell), began_s)
    except UnusableError as error:
        _write_error(response_folder, task, "unusable", str(error), error.cure)
    except RefusedError as error:
        _write_error(response_folder, task, "refused", str(error))
    except ConnectionError:  # nobody listens any more
        raise
    except Exception as error:
        traceback.print_exc()
        _write_error(response_folder, task, "broken", f"{type(error).__name__}: {error}")


def read_request(folder: Path, response_folder: Path) -> Request:
    """The request in ``folder``, its inputs held against their digests. Raises UnusableError and ValueError."""
    record = json.loads((folder / REQUEST_FILE).read_text(encoding="utf-8"))
    if record.get("protocol") != PROTOCOL:
        raise UnusableError(
            f"the request follows protocol {record.get('protocol')}, this side {PROTOCOL}",
            "Let both environments use the same R2S-EGO.",
        )
    files = {}
    for name, one in record["inputs"].items():
        files[name] = folder / plain_path(one["file"])
        if file_digest(files[name]) != one["sha256"]:
            raise ValueError(f"the input {name} is not what was sent")
    return Request(record["task"], record["backend"], record["parameters"], files, response_folder)


def write_answer(folder: Path, task: str, given: Answer, began_s: float) -> None:
    """Write a response, ``response.json`` last. ``began_s`` by ``time.monotonic``."""
    record = {
        "protocol": PROTOCOL,
        "task": task,
        "backend": given.backend,
        "weights": given.weights,
        "values": given.values,
        "outputs": {name: write_part(folder, name, one) for name, one in given.outputs.items()},
        "seconds": time.monotonic() - began_s,
    }
    _write_record(folder / RESPONSE_FILE, record)


def write_part(folder: Path, name: str, given: np.ndarray | Path, move: bool = True) -> dict[str, Any]:
    """Put an array, or a file, into ``folder`` under its name; what the record says of it."""
    told: dict[str, Any] = {}
    if isinstance(given, Path):
        file = plain_path(name if name.endswith(given.suffix) else name + given.suffix)
    else:
        file = plain_path(f"{name}.npy")
        told = {"dtype": given.dtype.str, "shape": list(given.shape)}
    place = folder / file
    place.parent.mkdir(parents=True, exist_ok=True)
    if not isinstance(given, Path):
        np.save(place, given, allow_pickle=False)
    elif not (place.exists() and place.samefile(given)):
        (shutil.move if move else shutil.copyfile)(str(given), str(place))
    return {"file": file, "sha256": file_digest(place), **told}


def file_digest(file: str | Path) -> str:
    """SHA-256 of a file's bytes."""
    digest = hashlib.sha256()
    with open(file, "rb") as stream:  # noqa: PTH123
        for block in iter(lambda: stream.read(_PIECE), b""):
            digest.update(block)
    return digest.hexdigest()


def plain_path(path: Any) -> str:
    """``path`` where it names a file within a folder, without a way out of it. Raises ValueError for others."""
    if not (isinstance(path, str) and _PLAIN.fullmatch(path)) or path.endswith("."):
        raise ValueError(f"{str(path)[:100]!r} is no plain name of a file")
    return path


def content_of(folder: Path) -> tuple[bytes, int]:
    """The line that goes ahead of a folder's files on a connection, and the bytes of all."""
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    listed = [(file.relative_to(folder).as_posix(), file.stat().st_size) for file in files]
    line = json.dumps(listed).encode() + b"\n"
    return line, len(line) + sum(size for _, size in listed)


def send_folder(folder: Path, stream: BufferedIOBase) -> None:
    """Write a folder on a connection: a line with names and sizes, then the files' bytes."""
    line, _ = content_of(folder)
    stream.write(line)
    for name, _ in json.loads(line):
        with (folder / name).open("rb") as file:
            shutil.copyfileobj(file, stream, _PIECE)


def receive_folder(stream: BufferedIOBase, folder: Path, most_bytes: int, most_files: int) -> None:
    """Write what ``send_folder`` sends into an empty folder. Raises ValueError beyond the bounds, and OSError."""
    line = stream.readline(_MOST_LINE)
    try:
        listed = json.loads(line)
        sizes: dict[str, int] = {plain_path(name): size for name, size in listed}
    except (TypeError, AttributeError, RecursionError) as error:
        raise ValueError("it has no list of files") from error
    if not all(type(size) is int and size >= 0 for size in sizes.values()):
        raise ValueError("its files have no sizes")
    if len(sizes) != len(listed) or len(listed) > most_files:
        raise ValueError(f"it has {len(listed)} files, of at most {most_files}, or one twice")
    if sum(sizes.values()) > most_bytes:
        raise ValueError(f"it has {sum(sizes.values())} bytes, of at most {most_bytes}")
    for name, size in sizes.items():
        place = folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        with place.open("xb") as file:
            while size:
                block = stream.read(min(size, _PIECE))
                if not block:
                    raise ValueError("it is cut off")
                file.write(block)
                size -= len(block)


def _serve_lines(tasks: Mapping[str, Task]) -> None:
    """What a model prints, or starts, must neither be read as progress nor take requests."""
    told = os.fdopen(os.dup(1), "w", encoding="ascii")
    asked = os.fdopen(os.dup(0), "r", encoding="utf-8")
    os.dup2(2, 1)
    with open(os.devnull, "rb") as nothing:  # noqa: PTH123
        os.dup2(nothing.fileno(), 0)

    def tell(done: int, total: int, text: str = "") -> None:
        told.write(json.dumps({"done": int(done), "total": int(total), "text": str(text)[:_MOST_TOLD]}) + "\n")
        told.flush()

    for line in asked:
        folders = json.loads(line)
        answer(Path(folders["request"]), Path(folders["response"]), tasks, tell)


def _token(file: Path | None) -> str:
    token = (file.read_text(encoding="utf-8") if file else os.environ.get(TOKEN_VARIABLE, "")).strip()
    if len(token) < LEAST_TOKEN:
        sys.exit(f"a token of at least {LEAST_TOKEN} characters is needed: --token-file FILE, or {TOKEN_VARIABLE}")
    return token


class _Server(socketserver.ThreadingTCPServer):
    """Answers one request at a time; whoever has no token holds nobody up."""

    allow_reuse_address = os.name != "nt"
    daemon_threads = True

    def __init__(self, port: int, token: str, tasks: Mapping[str, Task]) -> None:
        super().__init__(("127.0.0.1", port), _Handler)
        self.token, self.tasks, self.free = token, tasks, threading.Lock()


class _Handler(BaseHTTPRequestHandler):
    timeout = _STALLED_S
    server: _Server

    def do_GET(self) -> None:
        """Say what is served, to whoever has the token."""
        if self._is_known():
            told = json.dumps({"protocol": PROTOCOL, "tasks": sorted(self.server.tasks)})
            self.send_response(200)
            self.end_headers()
            self.wfile.write(told.encode())

    def do_POST(self) -> None:
        """Answer a request with lines of progress, a line ``{"answer": true}``, and the response's folder."""
        if not self._is_known():
            return
        with tempfile.TemporaryDirectory(prefix="r2sego-") as folder:
            asked, answered = Path(folder, "request"), Path(folder, "response")
            asked.mkdir()
            answered.mkdir()
            try:
                receive_folder(self.rfile, asked, MOST_BYTES, MOST_FILES)
            except ValueError as error:
                self.send_error(400, str(error)[:_MOST_TOLD])
                return
            self.send_response(200)
            self.end_headers()
            with self.server.free:
                answer(asked, answered, self.server.tasks, self._tell)
            self.wfile.write(b'{"answer": true}\n')
            send_folder(answered, self.wfile)

    def _is_known(self) -> bool:
        host = self.headers.get("Host") or ""
        if host.partition(":")[0] not in _HOSTS:  # a page in a browser that has another name for this machine
            self.send_error(403)
            return False
        given = (self.headers.get("Authorization") or "").encode()
        if not hmac.compare_digest(given, f"Bearer {self.server.token}".encode()):
            self.send_error(401)
            return False
        return True

    def _tell(self, done: int, total: int, text: str = "") -> None:
        """Raises ConnectionError where whoever asked has gone: the task is over."""
        line = json.dumps({"done": int(done), "total": int(total), "text": str(text)[:_MOST_TOLD]})
        self.wfile.write(line.encode() + b"\n")


def _write_error(folder: Path, task: str, kind: str, what: str, cure: str = "") -> None:
    error = {"kind": kind, "what": what[:_MOST_TOLD], "cure": cure[:_MOST_TOLD]}
    _write_record(folder / RESPONSE_FILE, {"protocol": PROTOCOL, "task": task, "error": error})


def _write_record(file: Path, record: Mapping[str, Any]) -> None:
    unfinished = file.with_name(file.name + ".tmp")
    unfinished.write_bytes(json.dumps(record).encode())
    unfinished.replace(file)
