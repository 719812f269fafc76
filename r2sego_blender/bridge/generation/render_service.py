"""Blender's side of ``workers.blender_renderer``: conditions on request, over JSON lines.

Requests come on standard input and answers leave on standard output, one JSON object a
line; whatever Blender itself prints goes to standard error. The service ends with its
input, so with the process that started it.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from queue import SimpleQueue
from typing import Any, TextIO

import bpy

from ...core.cameras import Camera
from ...core.errors import R2SEgoError
from ...geometry.proxy.proxy import GeometryProxy
from ..shared import versions
from .conditions import ConditionScene, render_path

PROTOCOL = 1
"""Version of requests and answers; the first line names it."""

_MARGIN_S = 10


def serve() -> None:
    """Answer requests until standard input ends."""
    answers = _answers_alone_on_stdout()
    requests: SimpleQueue[str] = SimpleQueue()
    threading.Thread(target=_read_requests, args=(requests,), daemon=True).start()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    _say(answers, {"ready": PROTOCOL, "blender": versions.VERSION})
    service = _Service(answers)
    while True:
        try:
            service.render(json.loads(requests.get()))
            answer = {"done": True}
        except R2SEgoError as error:
            answer = {"error": type(error).__name__, "what": error.what, "where": error.where, "cure": error.cure}
        except Exception as error:
            answer = {"error": "", "what": f"{type(error).__name__}: {error}", "where": None, "cure": ""}
        _say(answers, answer)


class _Service:
    """The scene of the last request, kept for the next."""

    def __init__(self, answers: TextIO) -> None:
        self._answers = answers
        self._shown: tuple[str, str] | None = None
        self._scene: ConditionScene | None = None

    def render(self, request: Mapping[str, Any]) -> None:
        wanted = (request["proxy"], request["engine"])
        path = [Camera.from_json(camera) for camera in request["cameras"]]
        # Whoever asks counts too and ends this process; this is for when they cannot any more.
        limit_s = int(request["frame_limit_s"]) + _MARGIN_S

        def on_frame(index: int) -> None:
            _die_after(limit_s)
            _say(self._answers, {"frame": index})

        try:
            _die_after(limit_s)
            if self._shown != wanted:
                self._show(*wanted)
            render_path(self._scene, path, Path(request["folder"]), request["engine"], on_frame)
        finally:
            _die_after(0)

    def _show(self, proxy_file: str, engine: str) -> None:
        if self._scene is not None:
            self._scene.remove()
        self._shown = self._scene = None
        self._scene = ConditionScene(GeometryProxy.load(Path(proxy_file)), engine)
        self._shown = proxy_file, engine


def _answers_alone_on_stdout() -> TextIO:
    """The standard output as it was; what else is printed, also by C code, goes to standard error."""
    sys.stdout.flush()
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    return answers


def _read_requests(requests: SimpleQueue[str]) -> None:
    for line in sys.stdin:
        requests.put(line)
    os._exit(0)  # whoever asked is gone, and nobody waits for a render under way


def _die_after(seconds: int) -> None:
    """Let the system end this process then, even one that hangs in Blender; 0 for never."""
    if hasattr(signal, "alarm"):
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(seconds)


def _say(answers: TextIO, answer: Mapping[str, Any]) -> None:
    answers.write(json.dumps(answer) + "\n")
    answers.flush()
