"""Learned models in environments of their own: what their adapters have in common.

Each needs another Python, another torch and a licence of its own, so it runs in the
interpreter that an environment variable names. This file is imported there too: it uses
the standard library alone.
"""

from __future__ import annotations

import importlib.metadata
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..core.errors import MachineError, NativeError

PROTOCOL = 1
"""Version of the requests and results of the adapters; both sides have to name it."""


def named_python(variable: str, backend: str, where: str, cure: str) -> str:
    """The interpreter that the environment ``variable`` names. Raises MachineError without one."""
    python = os.environ.get(variable, "")
    if not python:
        raise MachineError(f"{backend} is not set up on this machine", where=where, cure=cure)
    if not Path(python).is_file():
        raise MachineError(f"{variable} names no file", where=python, cure=cure)
    return python


def accepted_version(package: str, series: Sequence[str], backend: str, variable: str, cure: str) -> str:
    """The installed version of ``package``, if it is of one of the ``series`` such as "0.1".

    Raises MachineError for another one: its interface may differ from what was published.
    """
    try:
        version = importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError as error:
        raise MachineError(f"{backend} is not there: no package {package}", where=variable, cure=cure) from error
    if ".".join(version.split(".")[:2]) not in series:
        raise MachineError(
            f"{backend} is of version {version}, and this adapter follows {' and '.join(series)}",
            where=variable,
            cure=cure,
        )
    return version


def require_gpu(torch: Any, backend: str, variable: str, cure: str) -> None:
    """Raises MachineError where torch finds no NVIDIA GPU."""
    if not torch.cuda.is_available():
        raise MachineError(f"{backend} needs an NVIDIA GPU", where=variable, cure=cure)


def checked_request(request: dict[str, Any]) -> None:
    """Raises NativeError when the other side asks by another protocol."""
    if request.get("protocol") != PROTOCOL:
        raise NativeError(
            f"the request follows protocol {request.get('protocol')}, this side {PROTOCOL}",
            cure="Let both environments use the same R2S-EGO.",
        )


def checked_result(result: dict[str, Any], backend: str, names: Sequence[str]) -> None:
    """Raises NativeError unless a result follows the protocol and has all it declares."""
    missing = [name for name in ("protocol", "backend", *names) if name not in result]
    if missing or result["protocol"] != PROTOCOL:
        what = f"lacks {', '.join(missing)}" if missing else f"follows protocol {result['protocol']}"
        raise NativeError(f"the result of {backend} {what}", cure="Update the adapter's environment.")
