"""Drawings over the 3D view that belong to a panel: each owns its draw handler."""

from collections.abc import Callable

import bpy


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
