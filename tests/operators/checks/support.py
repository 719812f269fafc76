"""What the checks share: the bundle, the stand-in engine, and how to ask for a refusal."""

import json
import shutil
import sys
from pathlib import Path

import bpy

ZIP, BUNDLE, ENGINE, OUT = (Path(argument) for argument in sys.argv[sys.argv.index("--") + 1 :])
MODULE = "bl_ext.user_default.r2sego"


def state():
    """What the Blender scene knows of the bundle."""
    return bpy.context.scene.r2sego


def open_bundle(path=BUNDLE):
    """Start from an empty file with the bundle open, and nothing of it shown."""
    bpy.ops.wm.read_homefile(use_empty=True)
    assert bpy.ops.r2sego.open_scene(directory=str(path), show=False) == {"FINISHED"}


def copied_bundle():
    """A copy of the bundle that a check may write into, opened."""
    copy = bundle_of_one_name()
    open_bundle(copy)
    return copy


def bundle_of_one_name():
    """A copy of the bundle in a folder of the same name elsewhere."""
    copy = OUT.parent / "copies" / BUNDLE.name
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(BUNDLE, copy)
    return copy


def startup_file():
    """Blender as it starts: with its cube, and the add-on."""
    bpy.ops.wm.read_homefile(use_empty=False, use_factory_startup=True)
    bpy.ops.preferences.addon_enable(module=MODULE)
    preferences().engine_python = str(ENGINE)


def open_here(path):
    """Open a bundle in the Blender scene in which another one is open, and show nothing of it."""
    assert bpy.ops.r2sego.open_scene(directory=str(path), show=False) == {"FINISHED"}


def conduct(text):
    """What the stand-in engine does from now on: succeed, fail, lack a package, sleep; forgets its calls."""
    (ENGINE.parent / "conduct.txt").write_text(text)
    (ENGINE.parent / "calls.jsonl").unlink(missing_ok=True)


def calls():
    """The command lines the engine was started with, behind ``r2sego``."""
    return [json.loads(line) for line in (ENGINE.parent / "calls.jsonl").read_text().splitlines()]


def refused(operator, *how, **properties):
    """What the operator says when it refuses."""
    try:
        operator(*how, **properties)
    except RuntimeError as error:
        return str(error)
    raise AssertionError(f"{operator} was not refused")


def preferences():
    """The add-on's preferences."""
    return bpy.context.preferences.addons[MODULE].preferences
