"""Drawings over the 3D view that belong to a panel: each owns its draw handler."""

from collections.abc import Callable

import bpy

_MOST_POINTS = 16_000
"""Discs that a processor in place of a graphics card draws in some hundredths of a second."""


def timeline_runs(context: bpy.types.Context) -> bool:
    """Whether the timeline plays or the mouse drags along it."""
    return context.screen.is_animation_playing or context.screen.is_scrubbing


def points_while_moving(count: int, device: str) -> int:
    """How many of ``count`` points are drawn while something moves: all, but for OpenGL in software.

    ``device`` is what ``gpu.platform.device_type_get`` tells.
    """
    return min(count, _MOST_POINTS) if device == "SOFTWARE" else count


class Overlay:
    """A drawing over every 3D view, from ``register`` to ``unregister``.

    ``kind`` is ``POST_VIEW`` for world coordinates (metres) or ``POST_PIXEL`` for pixels of
    the region. ``draw(context)`` must be quick and must not raise. Without a window nothing
    is drawn, so nothing is registered.
    """

    def __init__(self, draw: Callable[[bpy.types.Context], None], kind: str) -> None:
        self._draw = draw
        self._kind = kind
        self._handle = None

    def register(self) -> None:
        """Start drawing."""
        if not bpy.app.background:
            self._handle = bpy.types.SpaceView3D.draw_handler_add(self._call, (), "WINDOW", self._kind)

    def unregister(self) -> None:
        """Stop drawing."""
        if self._handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handle, "WINDOW")
            self._handle = None

    def _call(self) -> None:
        self._draw(bpy.context)
