"""The running job's preview picture as an icon of Blender."""

from pathlib import Path

import bpy
import bpy.utils.previews

_NAME = "picture"
_previews = None
_shown = ("", 0)  # file and its time of change


def show(engine: bpy.types.PropertyGroup) -> None:
    """Read the picture that ``engine.picture`` names, if it is new, into ``engine.picture_icon``."""
    global _previews, _shown
    if not engine.picture:
        engine.picture_icon = 0
        return
    try:
        seen = (engine.picture, Path(engine.picture).stat().st_mtime_ns)
    except OSError:  # being replaced, or gone with its job
        return
    if seen != _shown:
        if _previews is None:
            _previews = bpy.utils.previews.new()
        _previews.clear()
        picture = _previews.load(_NAME, engine.picture, "IMAGE")
        _ = picture.image_size[:]  # reads it now: else the panel shows a gap until Blender finds the time
        _shown = seen
    engine.picture_icon = _previews[_NAME].icon_id


def clear(engine: bpy.types.PropertyGroup) -> None:
    """Forget the picture."""
    global _previews, _shown
    engine.picture, engine.picture_icon, _shown = "", 0, ("", 0)
    if _previews is not None:
        bpy.utils.previews.remove(_previews)
        _previews = None
