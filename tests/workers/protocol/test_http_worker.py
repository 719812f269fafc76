"""Workers on this machine's loopback: a real server of ``serving``, and servers that are none."""

import json
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from r2sego_blender.core.errors import MachineError, NativeError
from r2sego_blender.core.progress import Progress
from r2sego_blender.workers.protocol.asking import ask
from r2sego_blender.workers.protocol.http_worker import HttpWorker
from r2sego_blender.workers.protocol.request import Request
from r2sego_blender.workers.protocol.response import Limits, RefusedRequestError
from r2sego_blender.workers.protocol.serving import TOKEN_VARIABLE

TOKEN = "a token of this test"
PHOTOGRAPH = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
REQUEST = Request("depth", "stand-in", {"near_m": 0.5}, {"photograph": PHOTOGRAPH})
WAYS = """
def depth(request, progress):
    way = request.parameters.get("way", "")
    for done in range(200 if way == "long" else 1):
        progress(done, 200)
        time.sleep(0.02 if way == "long" else 0)
    pathlib.Path(__file__).with_suffix(".done").touch()
    if way == "refuses":
        raise RefusedError("too dark")
    if way == "raises":
        raise RuntimeError("out of memory")
    if way == "dies":
        os._exit(1)
    if way == "hangs":
        time.sleep(3)
    size = 600_000 if way == "too much" else 6
    return Answer("Stand-in 1.2", RANDOM if way == "random" else "b" * 64, {"depth": np.ones((4, size), np.float32)})
serve({"depth": depth})
"""


@pytest.fixture
def token_file(tmp_path, monkeypatch) -> Path:
    monkeypatch.delenv(TOKEN_VARIABLE, raising=False)
    (tmp_path / "token").write_text(f"{TOKEN}\n")
    return tmp_path / "token"


class Server:
    def __init__(self, script: Path, token_file: Path) -> None:
        self.script = script
        command = [sys.executable, str(script), "--http", "0", "--token-file", str(token_file)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.port = json.loads(self.process.stdout.readline())["port"]

    def worker(self, token_file: Path | None = None, host: str = "127.0.0.1") -> HttpWorker:
        return HttpWorker(f"http://{host}:{self.port}", "served", "Mend it.", token_file)


@pytest.fixture
def server(worker_of, token_file) -> Iterator[Server]:
    server = Server(worker_of.script(WAYS), token_file)
    yield server
    server.process.kill()
    server.process.wait()
    server.process.stdout.close()


def depth_of(worker, limits=Limits(), **parameters) -> np.ndarray:
    request = Request("depth", "", parameters, {"photograph": PHOTOGRAPH})
    with ask(worker, request, limits=limits) as response:
        return response.array("depth", (4, 6))


def test_a_server_answers_as_a_program_does(server, token_file, monkeypatch):
    for host in ("127.0.0.1", "localhost"):
        assert (depth_of(server.worker(token_file, host)) == 1.0).all()
    monkeypatch.setenv(TOKEN_VARIABLE, TOKEN)
    monkeypatch.setenv("http_proxy", "http://192.0.2.1:9")  # a proxy of the environment is not asked
    with ask(server.worker(), REQUEST) as response:
        assert (response.backend, response.weights) == ("Stand-in 1.2", "b" * 64)


@pytest.mark.parametrize(
    ("way", "kind", "said"),
    [
        ("raises", NativeError, "RuntimeError: out of memory"),
        ("refuses", RefusedRequestError, "too dark"),
        ("random", NativeError, "random weights"),
        ("too much", NativeError, "of at most"),
        ("hangs", NativeError, "said nothing for 1 s"),
        ("long", NativeError, "no answer after 2 s"),
        ("dies", NativeError, "ended without an answer|broke off"),
    ],
)
def test_a_server_that_breaks_costs_one_request(server, token_file, way, kind, said):
    worker, began_s = server.worker(token_file), time.monotonic()
    seconds = {"hangs": (60.0, 1.0), "long": (2.0, 60.0)}.get(way, (60.0, 60.0))
    limits = Limits(*seconds, answer_bytes=1 << 20)
    with pytest.raises(kind, match=said) as caught:
        depth_of(worker, limits, way=way)
    assert type(caught.value) is kind and caught.value.where == "served"
    assert time.monotonic() - began_s < 4.0 or way not in ("hangs", "long")
    if way == "dies":
        server.process.wait(10.0)
        with pytest.raises(MachineError, match="no worker answers there"):
            depth_of(worker)
    else:
        assert (depth_of(worker) == 1.0).all()


def test_a_task_ends_soon_after_its_asker_has_gone(server, token_file):
    class Gone(Progress):
        def task(self, title, total):
            raise KeyboardInterrupt

    worker = server.worker(token_file)
    request = Request("depth", "", {"way": "long"}, {"photograph": PHOTOGRAPH})
    with pytest.raises(KeyboardInterrupt), ask(worker, request, Gone()):
        pass
    began_s = time.monotonic()
    assert (depth_of(worker) == 1.0).all()  # it waits for the other
    assert time.monotonic() - began_s < 2.0  # of 4 s that the other would take


def test_another_token_is_refused_before_anything_is_sent(server, tmp_path):
    (tmp_path / "other").write_text(TOKEN[:-1] + "x")
    with pytest.raises(MachineError, match="another token"):
        depth_of(server.worker(tmp_path / "other"))
    assert not server.script.with_suffix(".done").exists()


@pytest.mark.parametrize("token", ["", "short", "x" * 5000, "a token with\na line of its own"])
def test_a_token_that_is_none_is_refused(server, tmp_path, token, monkeypatch):
    monkeypatch.delenv(TOKEN_VARIABLE, raising=False)
    (tmp_path / "other").write_text(token)
    with pytest.raises(MachineError, match="token"):
        server.worker(tmp_path / "other")
    with pytest.raises(MachineError, match="token"):
        server.worker()


@pytest.mark.parametrize(
    "address",
    [
        "http://example.com:80",
        "http://192.168.0.7:80",
        "http://0.0.0.0:80",
        "http://127.0.0.1.example.com:80",
        "http://127.0.0.1@example.com:80",
        "http://user@127.0.0.1:80",
        "https://127.0.0.1:80",
        "file:///etc/passwd",
        "http://127.0.0.1",
        "http://127.0.0.1:99999",
        "http://[::1",
        "",
    ],
)
def test_any_other_machine_is_refused(token_file, address):
    with pytest.raises(MachineError):
        HttpWorker(address, "served", "Mend it.", token_file)


def raw(port: int, *lines: str, then: bytes = b"") -> bytes:
    """What a server says to words that no ``HttpWorker`` writes."""
    with socket.create_connection(("127.0.0.1", port), timeout=10.0) as connection:
        connection.sendall("\r\n".join([*lines, "", ""]).encode() + then)
        connection.shutdown(socket.SHUT_WR)
        return b"".join(iter(lambda: connection.recv(1 << 16), b""))


def test_a_server_takes_no_words_of_strangers(server, tmp_path):
    known = f"Authorization: Bearer {TOKEN}"
    here = f"Host: 127.0.0.1:{server.port}"
    assert b" 401 " in raw(server.port, "POST / HTTP/1.0", here)
    assert b" 401 " in raw(server.port, "GET / HTTP/1.0", here, "Authorization: Bearer ")
    assert b" 403 " in raw(server.port, "POST / HTTP/1.0", "Host: example.com", known)
    assert b'"tasks": ["depth"]' in raw(server.port, "GET / HTTP/1.0", here, known)
    outside = tmp_path / "outside"
    for listed in (
        [[str(outside), 1]],
        [["../../outside", 1]],
        [["a", -1]],
        [["a", 1], ["a", 1]],
        [["a", 1 << 60]],
        [["a", 9]],
        [["a"]],
        {"a": 1},
        7,
        [[[], 1]],
    ):
        said = raw(server.port, "POST / HTTP/1.0", here, known, then=json.dumps(listed).encode() + b"\nx")
        assert b" 400 " in said, listed
    assert not outside.exists()
    assert not server.script.with_suffix(".done").exists()


@pytest.mark.skipif(not Path("/proc/net/tcp").is_file(), reason="told by Linux's /proc")
def test_a_server_listens_on_this_machine_alone(server):
    fields = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    listening = [one[1] for one in fields if one[3] == "0A" and int(one[1].rpartition(":")[2], 16) == server.port]
    assert listening and all(place.startswith("0100007F:") for place in listening)


@pytest.mark.parametrize(
    "said",
    [
        b"",
        b"no HTTP\r\n\r\n",
        b"HTTP/1.0 500 no\r\n\r\n",
        b"HTTP/1.0 302 there\r\nLocation: http://example.com/\r\n\r\n",
        b"HTTP/1.0 200 OK\r\n\r\n" + b"x" * 300_000,
        b'HTTP/1.0 200 OK\r\n\r\n{"answer": true}\n[["response.json", 5]]\nab',
        b'HTTP/1.0 200 OK\r\n\r\n{"answer": true}\n[["../x", 2]]\nab',
        b'HTTP/1.0 200 OK\r\n\r\n{"answer": true}\n[["x", 99999999999]]\nab',
        b'HTTP/1.0 200 OK\r\n\r\n{"answer": true}\n' + b"[" * 200_000,
        b'HTTP/1.0 200 OK\r\n\r\n{"answer": true}\n[]\n',
    ],
)
def test_a_server_that_is_another_program_is_an_error_in_a_line(token_file, tmp_path, said):
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            for _ in range(2):  # whether it knows us, and the request
                connection, _ = listener.accept()
                with connection:
                    connection.settimeout(5.0)
                    connection.recv(1 << 20)
                    connection.sendall(said)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        worker = HttpWorker(f"http://127.0.0.1:{listener.getsockname()[1]}", "served", "Mend it.", token_file)
        with pytest.raises((MachineError, NativeError)) as caught:
            depth_of(worker, Limits(seconds=5.0, silent_s=2.0, answer_bytes=1 << 20))
        assert caught.value.where == "served" and "\n" not in str(caught.value)
        assert [file.name for file in tmp_path.iterdir()] == ["token"]
