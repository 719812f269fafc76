"""The behaviours that there are: the modules of this folder that declare one."""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil
from pathlib import Path

from .behaviour import Behaviour


def _found() -> tuple[Behaviour, ...]:
    names = [module.name for module in pkgutil.iter_modules([str(Path(__file__).parent)])]
    modules = [importlib.import_module(f".{name}", __package__) for name in names if name != "registry"]
    declared = [
        dataclasses.replace(module.BEHAVIOUR, name=module.__name__.rpartition(".")[2])
        for module in modules
        if hasattr(module, "BEHAVIOUR")
    ]
    return tuple(sorted(declared, key=lambda one: (one.place is None, one.place, one.name)))


BEHAVIOURS = _found()
"""All of them, in the order in which they are listed and drawn."""
