"""Where the add-on keeps files of its own that belong to no scene bundle."""

from __future__ import annotations

from pathlib import Path

import bpy

_ADDON = __package__.rsplit(".", 2)[0]
_NAME = "r2sego"


def user_folder(name: str) -> Path:
    """The folder ``name`` among the extension's files, or Blender's if it is none; made if missing."""
    try:
        return Path(bpy.utils.extension_path_user(_ADDON, path=name, create=True))
    except ValueError:  # a script on a checkout
        return Path(bpy.utils.user_resource("DATAFILES", path=f"{_NAME}/{name}", create=True))
