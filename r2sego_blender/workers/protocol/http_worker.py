"""Workers on this machine's loopback, asked by HTTP with a token."""

from __future__ import annotations

import contextlib
import http.client
import io
import json
import os
import time
import urllib.parse
from collections.abc import Iterator
from pathlib import Path

from ...core.errors import MachineError, NativeError
from ...core.text_files import read_text
from .asking import Tell
from .response import Limits
from .serving import LEAST_TOKEN, TOKEN_VARIABLE, content_of, receive_folder

_HOSTS = ("127.0.0.1", "::1", "localhost")
_MOST_LINE, _PIECE, _MOST_TOKEN = 1 << 16, 1 << 20, 4096


class HttpWorker:
    """A server of ``serving`` that somebody started on this machine. It is asked, never started or ended, by this."""

    def __init__(self, address: str, name: str, cure: str, token_file: Path | None = None) -> None:
        """``address`` such as "http://127.0.0.1:8765"; the token is in ``token_file``, else in ``R2SEGO_WORKER_TOKEN``.

        Raises MachineError for another host than this machine's loopback, and without a token.
        """
        self.name, self.cure = name, cure
        try:
            parts = urllib.parse.urlsplit(address)
            port = parts.port
        except ValueError:
            port = None
        if port is None or parts.scheme != "http" or parts.hostname not in _HOSTS or parts.username is not None:
            raise MachineError(
                "a worker has to be on this machine: http://127.0.0.1:PORT", where=address, cure="Start it here."
            )
        self._place = "127.0.0.1" if parts.hostname == "localhost" else parts.hostname, port
        self._headers = {"Authorization": f"Bearer {_token(token_file)}"}

    def answer(self, request: Path, response: Path, tell: Tell, limits: Limits) -> None:
        """See ``asking.Worker``. A task whose asker has gone ends with its next word of progress."""
        deadline_s = time.monotonic() + limits.seconds
        try:
            self._require_known(limits)
            with self._connection(limits) as connection:
                headers = self._headers | {"Content-Length": str(content_of(request)[1])}
                connection.request("POST", "/", body=_pieces(request), headers=headers)
                lines = io.BufferedReader(_Timed(connection, deadline_s, limits.silent_s), _PIECE)
                while line := lines.readline(_MOST_LINE):
                    with contextlib.suppress(ValueError, RecursionError):
                        told = json.loads(line)
                        if isinstance(told, dict):
                            if "answer" in told:
                                break
                            tell(told)
                else:
                    raise self._broken("ended without an answer")
                receive_folder(lines, response, limits.answer_bytes, limits.files)
        except ConnectionRefusedError as error:
            raise MachineError("no worker answers there", where=self.name, cure=self.cure) from error
        except TimeoutError as error:
            late = time.monotonic() >= deadline_s
            how = f"had no answer after {limits.seconds:.0f} s" if late else f"said nothing for {limits.silent_s:.0f} s"
            raise self._broken(how) from error
        except (OSError, ValueError, http.client.HTTPException) as error:
            raise self._broken(f"broke off: {error}") from error

    def close(self) -> None:
        """Nothing of it runs here."""

    def _require_known(self, limits: Limits) -> None:
        """Raises MachineError where the token is not the server's, before anything is sent."""
        with self._connection(limits) as connection:
            connection.request("GET", "/", headers=self._headers)
            status = connection.getresponse().status
            if status == http.HTTPStatus.UNAUTHORIZED:
                raise MachineError("the worker has another token", where=self.name, cure=self.cure)
            if status != http.HTTPStatus.OK:
                raise MachineError(
                    f"no worker answers there, but HTTP status {status}", where=self.name, cure=self.cure
                )

    @contextlib.contextmanager
    def _connection(self, limits: Limits) -> Iterator[http.client.HTTPConnection]:
        connection = http.client.HTTPConnection(*self._place, timeout=min(limits.seconds, limits.silent_s))
        with contextlib.closing(connection):
            yield connection

    def _broken(self, how: str) -> NativeError:
        return NativeError(f"the worker {how}", where=self.name, cure=self.cure)


class _Timed(io.RawIOBase):
    """What a server sends, each piece within a time, and all of it."""

    def __init__(self, connection: http.client.HTTPConnection, deadline_s: float, silent_s: float) -> None:
        """Raises ValueError where the request was not taken."""
        self._socket, self._deadline_s, self._silent_s = connection.sock, deadline_s, silent_s
        self._answer = connection.getresponse()
        if self._answer.status != http.HTTPStatus.OK:
            raise ValueError(f"HTTP status {self._answer.status}")

    def readable(self) -> bool:
        return True

    def readinto(self, place: memoryview) -> int:  # type: ignore[override]
        left_s = self._deadline_s - time.monotonic()
        if left_s <= 0:
            raise TimeoutError
        self._socket.settimeout(min(left_s, self._silent_s))
        data = self._answer.read1(len(place))
        place[: len(data)] = data
        return len(data)


def _pieces(folder: Path) -> Iterator[bytes]:
    line, _ = content_of(folder)
    yield line
    for name, _ in json.loads(line):
        with (folder / name).open("rb") as file:
            while piece := file.read(_PIECE):
                yield piece


def _token(file: Path | None) -> str:
    try:
        token = (read_text(file, _MOST_TOKEN) if file else os.environ.get(TOKEN_VARIABLE, "")).strip()
        token.encode("latin-1")
    except (OSError, ValueError) as error:
        raise MachineError(f"the worker's token cannot be read: {error}", where=file, cure="Write it again.") from error
    if len(token) < LEAST_TOKEN or not token.isprintable():
        raise MachineError(
            f"the worker's token has to have {LEAST_TOKEN} characters or more",
            where=file or TOKEN_VARIABLE,
            cure="Give the server and this side the same one.",
        )
    return token
