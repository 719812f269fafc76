"""A Blender without a window that stays, and renders structural conditions on request.

It is the Blender a person names or, where none is named, pip's bpy in this interpreter.
The other side is ``bridge.generation.render_service``.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import json
import os
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from ..core import errors
from ..core.cameras import Camera
from ..core.errors import MachineError, NativeError
from .child import RUNNING, forget
from .library_path import IMPORT_LIBRARY, LIBRARY
from .programs import find_program

FRAME_LIMIT_S = 600.0
"""Silence after which a Blender counts as hung, seconds: EEVEE first compiles its shaders."""

_PROTOCOL = 1
_REMEMBERED_LINES = 20
BLENDER_VARIABLE = "R2SEGO_BLENDER"
"""Names the Blender program: this machine's affair, which no bundle from elsewhere decides."""


class BlenderWorker:
    """One Blender process, started with the first request and again after it has died.

    It ends with this process, with ``close`` and with ``child.kill_children``.
    """

    def __init__(self, blender: str = "", frame_limit_s: float = FRAME_LIMIT_S) -> None:
        """``blender``: the program, or "" for pip's bpy in this interpreter."""
        self._blender = blender
        self._frame_limit_s = frame_limit_s
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._version = ""

    @property
    def version(self) -> str:
        """Blender's version, such as "4.5.15". Raises MachineError when it cannot be started."""
        with self._lock:
            self._start()
            return self._version

    @property
    def process_id(self) -> int | None:
        """The running Blender's process, None while there is none."""
        return self._process.pid if self._process is not None and self._process.poll() is None else None

    def render(
        self,
        proxy_file: Path,
        path: Sequence[Camera],
        engine: str,
        folder: Path,
        on_frame: Callable[[int], None] = lambda index: None,
    ) -> list[Path]:
        """Render the proxy of ``proxy_file`` from each camera with ``engine``, "cycles" or "eevee".

        The file must not change while this worker lives: Blender reads it once. Returns one
        multilayer EXR a camera in ``folder``, with the passes of ``bridge.conditions``;
        ``on_frame`` hears the index of each frame that is begun. Raises what
        went wrong in Blender, MachineError when it cannot be started, and NativeError when it
        died, hung or left no complete result.
        """
        request = {
            "proxy": str(proxy_file),
            "engine": engine,
            "folder": str(folder),
            "cameras": [camera.to_json() for camera in path],
            "frame_limit_s": self._frame_limit_s,
        }
        with self._lock:
            self._start()
            try:
                self._ask(request)
                answer = self._answer()
                while "frame" in answer:
                    on_frame(answer["frame"])
                    answer = self._answer()
            except BaseException:
                self._kill()  # what it would still say must not answer the next request
                raise
        if "error" in answer:
            kind = getattr(errors, answer["error"], NativeError)
            raise kind(answer["what"], where=answer["where"], cure=answer["cure"])
        return _complete_result(folder, len(path))

    def close(self) -> None:
        """End Blender, if it runs."""
        with self._lock:
            self._kill()

    def _start(self) -> None:
        if self.process_id is not None:
            return
        self._kill()
        command = _command(self._blender)
        try:
            # In this process's group, so that whoever ends the group ends Blender too.
            self._process = subprocess.Popen(
                command,
                env=_environment(),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                errors="replace",
            )
        except OSError as error:
            raise MachineError(
                f"Blender could not be started: {error}", where=command[0], cure=f"Name another in {BLENDER_VARIABLE}."
            ) from error
        RUNNING.add(self._process)
        self._lines: SimpleQueue[Mapping[str, Any] | None] = SimpleQueue()
        self._words: deque[str] = deque(maxlen=_REMEMBERED_LINES)
        self._listeners = [
            threading.Thread(target=_read_answers, args=(self._process, self._lines), daemon=True),
            threading.Thread(target=_read_words, args=(self._process, self._words), daemon=True),
        ]
        for listener in self._listeners:
            listener.start()
        try:
            hello = self._answer()
            if hello.get("ready") != _PROTOCOL:
                raise MachineError(
                    "this Blender answers another protocol",
                    where=command[0],
                    cure="Let both sides use the same R2S-EGO.",
                )
        except BaseException:
            self._kill()
            raise
        self._version = hello["blender"]

    def _ask(self, request: Mapping[str, Any]) -> None:
        assert self._process is not None and self._process.stdin is not None
        with contextlib.suppress(OSError):  # one that has died is told by its missing answer
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()

    def _answer(self) -> Mapping[str, Any]:
        try:
            answer = self._lines.get(timeout=self._frame_limit_s)
        except Empty:
            raise NativeError(
                f"Blender was silent for {self._frame_limit_s:.0f} s",
                where=self._blender or "bpy",
                cure=f"Use smaller images, or another Blender.{self._last_words()}",
            ) from None
        if answer is None:
            assert self._process is not None
            status = self._process.wait()
            self._listeners[1].join(1.0)
            raise NativeError(
                f"Blender ended without a result (exit status {status})",
                where=self._blender or "bpy",
                cure=f"Start it by hand to see why.{self._last_words()}",
            )
        return answer

    def _last_words(self) -> str:
        return f" Its last words: {self._words[-1][:300]}" if self._words else ""

    def _kill(self) -> None:
        if self._process is None:
            return
        self._process.kill()
        self._process.wait()
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # a request that was never read
            self._process.stdin.close()
        for listener in self._listeners:
            listener.join(1.0)
        forget(self._process)
        self._process = None


@functools.cache
def shared_worker(blender: str = "") -> BlenderWorker:
    """The worker of this process for ``blender``: rounds share it, as EEVEE is slow to start."""
    return BlenderWorker(blender)


def _command(blender: str) -> list[str]:
    """Raises MachineError when the named Blender, or bpy, is not there."""
    serve = f"{IMPORT_LIBRARY}\nfrom {LIBRARY.name}.bridge.generation.render_service import serve\nserve()\n"
    if not blender:
        if importlib.util.find_spec("bpy") is None:
            raise MachineError(
                "no Blender is chosen, and this Python has no bpy",
                where=BLENDER_VARIABLE,
                cure="Name a Blender 4.3 or later, or use the z-buffer.",
            )
        return [sys.executable, "-c", serve]
    program = Path(blender).expanduser()
    named_safely = program.is_absolute() or len(program.parts) == 1
    found = find_program(str(program)) if named_safely else None
    if found is None:
        raise MachineError(
            "this Blender is not there or cannot be run",
            where=blender,
            cure=f"Give its whole path in {BLENDER_VARIABLE}, or use the z-buffer.",
        )
    return [found, "--background", "--factory-startup", "-noaudio", "--python-exit-code", "1", "--python-expr", serve]


def _environment() -> dict[str, str]:
    # A Python's own variables would mislead the one inside Blender.
    kept = {key: value for key, value in os.environ.items() if key not in ("PYTHONHOME", "PYTHONSTARTUP")}
    return kept | {"PYTHONUTF8": "1"}


def _read_answers(process: subprocess.Popen, lines: SimpleQueue[Mapping[str, Any] | None]) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        with contextlib.suppress(json.JSONDecodeError):  # Blender greets before the service begins
            answer = json.loads(line)
            if isinstance(answer, dict):
                lines.put(answer)
    lines.put(None)


def _read_words(process: subprocess.Popen, words: deque[str]) -> None:
    assert process.stderr is not None
    words.extend(line.strip() for line in process.stderr if line.strip())


def _complete_result(folder: Path, frames: int) -> list[Path]:
    """The images of a finished path. Raises NativeError unless its manifest has them all."""
    with contextlib.suppress(OSError, ValueError):
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        files = [folder / frame["file"] for frame in manifest["frames"]]
        if manifest["complete"] and len(files) == frames and all(file.is_file() for file in files):
            return files
    raise NativeError("Blender left no complete result", where=folder, cure="Is the disk full?")
