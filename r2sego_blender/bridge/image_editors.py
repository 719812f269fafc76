"""The Image Editors on the screen, and pictures shown in them."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

_FIT_S = 0.5


def image_editors() -> Iterator[tuple[bpy.types.Window, bpy.types.Area]]:
    """Every Image Editor with its window; none in background."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                yield window, area


def show_in_editor(image: bpy.types.Image) -> bool:
    """Show it in the first Image Editor as that is zoomed; whether there is one."""
    for _, area in image_editors():
        area.spaces.active.image = image
        return True
    return False


def show_image(image: bpy.types.Image) -> bool:
    """Show the whole of it in an Image Editor, in a window of its own when none is open.

    False without a window.
    """
    windows = bpy.context.window_manager.windows
    if bpy.app.background or not len(windows):
        return False
    if next(image_editors(), None) is None:
        before = set(windows)
        bpy.ops.wm.window_new()
        opened = next((window for window in windows if window not in before), None)
        if opened is None:
            return False
        opened.screen.areas[0].type = "IMAGE_EDITOR"
    show_in_editor(image)
    bpy.app.timers.register(_fit, first_interval=_FIT_S)
    return True


def _fit() -> None:
    """Zoom until the whole image is seen; an editor knows its size only once it was drawn."""
    found = next(image_editors(), None)
    if found is not None:
        window, area = found
        region = next(region for region in area.regions if region.type == "WINDOW")
        with bpy.context.temp_override(window=window, area=area, region=region):
            bpy.ops.image.view_all(fit_view=True)
