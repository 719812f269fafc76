"""Icons of one colour for legends, made when they are first drawn."""

import bpy
import bpy.utils.previews

_SIDE_PX = 16
_icons: dict[str, "bpy.utils.previews.ImagePreviewCollection"] = {}


def swatch(colour) -> int:
    """The icon of an sRGB colour in [0, 1]."""
    icons = _icons["all"]
    name = "".join(f"{round(255 * part):02x}" for part in colour)
    if name not in icons:
        icon = icons.new(name)
        icon.icon_size = (_SIDE_PX, _SIDE_PX)
        icon.icon_pixels_float = (*colour, 1.0) * _SIDE_PX**2
    return icons[name].icon_id


def register() -> None:
    """Make room for the icons."""
    _icons["all"] = bpy.utils.previews.new()


def unregister() -> None:
    """Let them go."""
    bpy.utils.previews.remove(_icons.pop("all"))
