"""Colour swatches for the proxy's legend: icons of one colour, made when they are first drawn."""

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


def draw_legend(layout, group) -> None:
    """What each colour of the shown proxy means, and its area."""
    if group.older:
        layout.label(text="Redone since: press Show", icon="INFO")
    if group.legend_note:
        layout.label(text=group.legend_note, icon="INFO")
    column = layout.column(align=True)
    for line in group.legend:
        row = column.split(factor=0.68)
        row.label(text=line.name, icon_value=swatch(line.colour))
        area = row.row()
        area.alignment = "RIGHT"
        area.label(text=f"{line.area:.2f} m\u00b2")


def register() -> None:
    """Make room for the icons."""
    _icons["all"] = bpy.utils.previews.new()


def unregister() -> None:
    """Let them go."""
    bpy.utils.previews.remove(_icons.pop("all"))
