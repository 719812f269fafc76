"""The checks of the add-on, run inside Blender: pip bpy or a real one.

python tests/operators/in_blender.py -- ZIP BUNDLE ENGINE OUT.json
blender --background --python-exit-code 1 --python tests/operators/in_blender.py -- ZIP BUNDLE ENGINE OUT.json

Installs and enables ZIP as Blender itself does, runs every ``check_…`` of ``checks/`` on the
bundle with the stand-in engine, and writes what each said: "" when it held, else its
traceback. R2SEGO_CHECKS names single rooms, such as ``proxy,asset``, or files such as ``asset_marks``.
"""

import importlib
import json
import os
import sys
import traceback
from pathlib import Path

import bpy

CHECKS = Path(__file__).with_name("checks")
sys.path.insert(0, str(CHECKS))
from support import ENGINE, OUT, ZIP, preferences  # noqa: E402  # found beside the checks


def main():
    """Install, run, write, and fail when a check did."""
    bpy.ops.extensions.package_install_files(
        filepath=str(ZIP), repo="user_default", enable_on_install=True, overwrite=True
    )
    preferences().engine_python = str(ENGINE)
    rooms = tuple(f"{room}_" for room in os.environ.get("R2SEGO_CHECKS", "").split(",") if room)
    files = sorted(file.stem for file in CHECKS.glob("*.py"))
    said = {}
    for room in files:
        if rooms and not f"{room}_".startswith(rooms):
            continue
        for name, check in vars(importlib.import_module(room)).items():
            if name.startswith("check_"):
                said[f"{room}.{name}"] = _said(check)
    OUT.write_text(json.dumps(said, indent=1))
    print(f"{sum(not text for text in said.values())} of {len(said)} checks held")
    if any(said.values()):
        raise SystemExit(1)


def _said(check):
    try:
        check()
    except Exception:
        traceback.print_exc()
        return traceback.format_exc()
    return ""


main()
