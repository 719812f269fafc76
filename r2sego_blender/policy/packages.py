"""The packages of the extra ``policy``, which no other part needs."""

from __future__ import annotations

import importlib
from types import ModuleType

from ..core.errors import MachineError


def policy_package(name: str) -> ModuleType:
    """The module ``name`` of the extra ``policy``. Raises MachineError where it is not installed."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MachineError(
            f"training policies needs the package {name.partition('.')[0]}",
            cure="Install the extra `policy`: `make install POLICY=1`.",
        ) from error
