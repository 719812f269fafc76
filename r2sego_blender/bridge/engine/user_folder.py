"""Where the add-on keeps files of its own that belong to no scene bundle."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import bpy

_ADDON = __package__.rsplit(".", 3)[0]
_NAME = "r2sego"
_LOCAL_DATA = os.environ.get("LOCALAPPDATA", "") if sys.platform == "win32" else ""


def user_folder(name: str) -> Path:
    """The folder ``name`` among the extension's files, or Blender's if it is none; made if missing."""
    try:
        return Path(bpy.utils.extension_path_user(_ADDON, path=name, create=True))
    except ValueError:  # a script on a checkout
        return Path(bpy.utils.user_resource("DATAFILES", path=f"{_NAME}/{name}", create=True))


def engine_folder() -> Path:
    """Where the engine's environment stands: among the extension's files, made if missing.

    On Windows it is among the person's own instead, one for each Blender: its files' names are up to 167
    characters long within the packages, and the extension's folder takes most of the 260 of a whole path.
    """
    if _LOCAL_DATA:
        return Path(_LOCAL_DATA, _NAME, "engine-{}.{}".format(*bpy.app.version))
    return user_folder("engine")
