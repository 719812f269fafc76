"""The learned backends of this machine: which can be used, why others cannot, and what is known of each."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..core.errors import MachineError
from ..workers.learned_backends import LEARNED_BACKENDS, LearnedBackend
from ..workers.library_path import LEAVE_WORKING_FOLDER, external_variables
from ..workers.protocol.program_worker import library_command

NOT_TOLD = "not measured"
"""What stands for a figure that neither its authors tell nor anybody measured here."""

_FIND = f"""\
{LEAVE_WORKING_FOLDER}
import importlib.util, json
print(json.dumps([bool(importlib.util.find_spec(one)) for one in sys.argv[1:]]))
"""
_ANSWER_S = 60.0


def examine_backends(backends: Iterable[LearnedBackend] = tuple(LEARNED_BACKENDS.values())) -> dict[str, Any]:
    """The findings, JSON-ready: ``backends``, each with ``usable`` and ``why`` it is not. Nothing is fetched."""
    return {"backends": [_examined(one) for one in backends]}


def _examined(backend: LearnedBackend) -> dict[str, Any]:
    why = why_not(backend)
    return {
        "name": backend.name,
        "label": backend.label,
        "slot": backend.slot,
        "usable": not why,
        "why": why,
        "code_licence": backend.code_licence,
        "weights_licence": backend.weights_licence,
        "download": backend.download or NOT_TOLD,
        "memory": backend.memory or NOT_TOLD,
        "seconds": backend.seconds or NOT_TOLD,
        "source": backend.source,
        "variable": backend.variable,
        "installs": backend.recipe is not None,
    }


def why_not(backend: LearnedBackend) -> str:
    """Why ``backend`` cannot be used here, "" where it can."""
    try:
        python = backend.interpreter()
    except MachineError as error:
        return error.what
    for variable in backend.needs:
        if not Path(os.environ.get(variable, "")).is_dir() or not os.environ.get(variable):
            return f"{variable} names no folder"
    if backend.needs_gpu and shutil.which("nvidia-smi") is None:
        return "it needs an NVIDIA GPU, and none is found"
    told = _said([python, "-c", _FIND, *backend.modules])
    try:
        found = told.returncode == 0 and any(json.loads(told.stdout))
    except ValueError:
        found = False
    if not found:
        return f"{python} has no module {' or '.join(backend.modules)}"
    if backend.worker:
        checked = _said(library_command(python, f"workers.models.{backend.worker}", "--check", backend.name))
        if checked.returncode != 0:
            return next((line for line in reversed(checked.stderr.splitlines()) if line.strip()), "its check fails")[
                :300
            ]
    return ""


def _said(command: list[str]) -> subprocess.CompletedProcess[str]:
    """What a program of another environment says; one that hangs or cannot be started has failed."""
    try:
        return subprocess.run(
            command, env=external_variables(), capture_output=True, text=True, errors="replace", timeout=_ANSWER_S
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return subprocess.CompletedProcess(command, 1, "", f"{type(error).__name__}: it does not answer")


def lines(findings: dict[str, Any]) -> list[str]:
    """The findings as lines for a person."""
    text = []
    for one in findings["backends"]:
        text.append(f"{one['label']} ({one['name']}, {one['slot']}): {'usable' if one['usable'] else one['why']}")
        text.append(f"    licence: code {one['code_licence']}; weights {one['weights_licence']}")
        source = f" ({one['source']})" if one["source"] else ""
        text.append(
            f"    weights to download: {one['download']}; memory: {one['memory']}; seconds a photograph: "
            f"{one['seconds']}{source}"
        )
        if not one["usable"]:
            how = f"r2sego backend install {one['name']}, or set" if one["installs"] else "docs/backends.md; set"
            text.append(f"    to set it up: {how} {one['variable']}")
    return text
