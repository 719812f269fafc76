"""Which Python runs the engine, as the person chose it."""

from __future__ import annotations

import json
import sys

import bpy

from ...core.errors import MachineError
from ...workers.engine import ask, find_interpreter

ADDON_ID = "r2sego"
_ALL_BACKENDS_S = 300.0


def addon_preferences() -> bpy.types.AddonPreferences | None:
    """This add-on's preferences, None while it is not enabled (a script on a checkout)."""
    addons = bpy.context.preferences.addons
    return next((a.preferences for a in addons if a.module.rpartition(".")[2] == ADDON_ID), None)


def interpreter() -> str:
    """The engine's Python: the preference, else $R2SEGO_PYTHON, else pip bpy's own Python.

    Raises MachineError when there is none: Blender's own Python is never taken.
    """
    preferences = addon_preferences()
    preferred = bpy.path.abspath(preferences.engine_python) if preferences else ""
    return find_interpreter(preferred, fallback="" if bpy.app.binary_path else sys.executable)


def examine_backends() -> list[tuple[str, str, str]]:
    """Each learned backend: its label, why it cannot be used here, "" where it can, and its weights' licence.

    Raises MachineError when the engine cannot run.
    """
    python = interpreter()
    told = ask(["doctor", "--backends", "--json"], python, _ALL_BACKENDS_S)
    try:
        return [(one["label"], one["why"], one["weights_licence"]) for one in json.loads(told)["backends"]]
    except (ValueError, KeyError, TypeError) as error:
        raise _senseless(told, python) from error


def examine() -> str:
    """What the engine's Python is and lacks, in one line. Raises MachineError when it cannot run."""
    python = interpreter()
    told = ask(["doctor", "--json"], python)
    try:
        found = json.loads(told)
        versions = {package["name"]: package["version"] for package in found["packages"]}
        missing = [p["name"] for p in found["packages"] if p["required"] and not p["version"]]
        line = f"engine: Python {found['python']}, r2sego {found['r2sego']}, torch {versions['torch']}"
        ready = found["ready"]
    except (ValueError, KeyError, TypeError) as error:
        raise _senseless(told, python) from error
    if missing:
        return f"{line}; missing: {', '.join(missing)}"
    return line if ready else f"{line}; the disk is nearly full"


def _senseless(told: str, python: str) -> MachineError:
    return MachineError(
        f"the engine's answer makes no sense: {told.strip()[:120]}",
        where=python,
        cure="Choose another Python in the add-on's preferences.",
    )
