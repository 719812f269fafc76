"""The Image Editors on the screen, and pictures shown in them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

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


def show_image(image: bpy.types.Image, shown: Callable[[bpy.types.Image], None] | None = None) -> None:
    """Show the whole of it in an Image Editor, in a window of its own when none is open; then call ``shown``.

    Nothing without a window.
    """
    if bpy.app.background or not len(bpy.context.window_manager.windows):
        return
    # Not at once: a window that an operator opens crashes Blender where that is a step to undo.
    bpy.app.timers.register(partial(_show, image.name, shown), first_interval=0.0)


def _show(name: str, shown: Callable[[bpy.types.Image], None] | None) -> None:
    image = bpy.data.images.get(name)
    if image is None:  # undone meanwhile
        return
    if next(image_editors(), None) is None:
        _open_editor()
    if show_in_editor(image):
        if shown is not None:
            shown(image)
        bpy.app.timers.register(_fit, first_interval=_FIT_S)


def _open_editor() -> None:
    """An Image Editor in a window of its own."""
    windows = bpy.context.window_manager.windows
    before = set(windows)
    with bpy.context.temp_override(window=windows[0]):
        bpy.ops.wm.window_new()
    for opened in set(windows) - before:
        opened.screen.areas[0].type = "IMAGE_EDITOR"


def _fit() -> None:
    """Zoom until the whole image is seen; an editor knows its size only once it was drawn."""
    found = next(image_editors(), None)
    if found is not None:
        window, area = found
        region = next(region for region in area.regions if region.type == "WINDOW")
        with bpy.context.temp_override(window=window, area=area, region=region):
            bpy.ops.image.view_all(fit_view=True)
