"""The asset's splats over the 3D views: as Gaussians, blended as they were trained, or as quick discs.

A graphics card draws the Gaussians anew for each view. Without one they are drawn once the view has
come to rest, and while it moves, or the timeline runs, some of the splats are drawn as discs.
"""

import time
from functools import cached_property

import bpy
import gpu
import numpy as np

from ...r2sego_blender.bridge.asset.show_asset import DrawnSplats, drawn_splats, is_deleted
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from . import gaussian_splats, splat_discs
from .clipping_region import kept_sides
from .gaussian_splats import GaussianSplats, Seen
from .overlay import Overlay, points_while_moving, timeline_runs
from .splat_discs import SplatDiscs, drawn_count, scale_px

_SETTLED_S = 0.25
"""The view is at rest when it has not moved for so long."""

_MOST_WHILE_MOVING = 500_000
"""More Gaussians than this are sorted and drawn only once the view has come to rest."""

_MARKED = (1.0, 0.15, 0.1)
_FAINT = 0.05
"""Splats less opaque than this are not drawn as discs."""


class SplatBuffers:
    """The splats of one mesh, as they are marked at one time, on the graphics card once they are drawn."""

    def __init__(self, splats: DrawnSplats, backdrop: bool) -> None:
        self._splats, self._backdrop = splats, backdrop
        self._colours = colours_of(splats)
        self._disc_order = drawn_order(splats, backdrop)

    @property
    def disc_count(self) -> int:
        """How many of the splats are worth a disc."""
        return len(self._disc_order)

    @cached_property
    def discs(self) -> SplatDiscs:
        """The discs."""
        return SplatDiscs(self._splats, self._colours, self._disc_order)

    @cached_property
    def gaussians(self) -> GaussianSplats:
        """The Gaussians, and the pictures drawn of them."""
        chosen = np.flatnonzero(~self._splats.backdrop | self._backdrop)
        return GaussianSplats(self._splats, self._colours, chosen)


def drawn_order(splats: DrawnSplats, backdrop: bool) -> np.ndarray:
    """(M,) indices of the splats worth a disc, in an order of which each part is an even sample.

    Marked splats come first, so that they are seen however few are drawn.
    """
    worth = splats.opacities >= _FAINT
    if not backdrop:
        worth &= ~splats.backdrop
    order = np.random.default_rng(0).permutation(np.flatnonzero(worth))
    return order[np.argsort(~splats.marked[order], kind="stable")]


def colours_of(splats: DrawnSplats) -> np.ndarray:
    """(N, 4) float32: sRGB colour and opacity; marked splats are red and opaque."""
    srgb = splats.colours.copy()
    srgb[splats.marked] = 0.3 * srgb[splats.marked] + 0.7 * np.float32(_MARKED)
    opacities = np.where(splats.marked, 1.0, splats.opacities)
    return np.concatenate([srgb, opacities[:, None]], axis=1).astype(np.float32)


def gaussians_while_moving(count: int, device: str) -> bool:
    """Whether Gaussians are drawn anew while the view moves; ``device`` as in ``points_while_moving``."""
    return device != "SOFTWARE" and count <= _MOST_WHILE_MOVING


class _Motion:
    """Whether each 3D view stands still; a view that came to rest is drawn once more, in full."""

    def __init__(self) -> None:
        self._views: dict[int, tuple[tuple, float]] = {}

    def moving(self, key: int, matrix: tuple) -> bool:
        now = time.monotonic()
        before, since = self._views.get(key, (matrix, -_SETTLED_S))
        if before != matrix:
            self._views[key] = matrix, now
            if not bpy.app.timers.is_registered(_redraw_at_rest):
                bpy.app.timers.register(_redraw_at_rest, first_interval=_SETTLED_S)
            return True
        self._views[key] = matrix, since
        return now - since < _SETTLED_S

    def at_rest(self) -> bool:
        now = time.monotonic()
        return all(now - since >= _SETTLED_S for _, since in self._views.values())

    def clear(self) -> None:
        self._views.clear()


def _redraw_at_rest() -> float | None:
    if not _motion.at_rest():
        return _SETTLED_S / 2.0
    redraw_views("WINDOW")
    return None


_motion = _Motion()
_buffers: dict[tuple, SplatBuffers] = {}
"""The splats that were drawn last, by mesh, marks and choice."""


def drawn_for(mesh: bpy.types.Mesh, group: bpy.types.PropertyGroup) -> tuple:
    """Another value where the splats are drawn otherwise; undo brings marks back, and other ones follow."""
    marks = tuple(mark.region for mark in group.marks)
    return mesh.session_uid, len(mesh.vertices), marks, group.marked, group.backdrop


def _buffer(shown: bpy.types.Object, group: bpy.types.PropertyGroup) -> SplatBuffers | None:
    mesh = shown.data
    key = drawn_for(mesh, group)
    if key not in _buffers:
        _buffers.clear()
        if mesh.is_editmode:  # its attributes cannot be read; Edit Mode shows its own points
            return None
        splats = drawn_splats(mesh)
        buffers = SplatBuffers(splats, group.backdrop) if splats is not None else None
        if buffers is None or not buffers.disc_count:
            return None
        _buffers[key] = buffers
    return _buffers[key]


def _let_go_of_deleted() -> None:
    """Free the splats of an object that no Blender scene has any more; the graphics card is small."""
    shown = (scene.r2sego_asset.shown for scene in bpy.data.scenes)
    kept = {one.data.session_uid for one in shown if one is not None and not is_deleted(one)}
    for key in [key for key in _buffers if key[0] not in kept]:
        del _buffers[key]


def draw(context: bpy.types.Context) -> None:
    """Draw the shown asset into the current 3D view."""
    _let_go_of_deleted()
    group = context.scene.r2sego_asset
    shown = group.shown
    if not group.preview or shown is None or shown.mode == "EDIT":
        return
    if not shown.visible_get(viewport=context.space_data):
        return
    buffers = _buffer(shown, group)
    if buffers is None:
        return
    view, device = context.region_data, gpu.platform.device_type_get()
    clip_from_object = view.perspective_matrix @ shown.matrix_world
    sides = kept_sides(view)
    sides = sides @ np.array(shown.matrix_world) if sides is not None else None
    key = context.region.as_pointer()
    moving = _motion.moving(key, tuple(value for row in clip_from_object for value in row))
    moving |= timeline_runs(context)
    if group.style == "GAUSSIANS":
        gaussians = buffers.gaussians
        anew = not moving or gaussians_while_moving(gaussians.count, device)
        if gaussians.draw(key, Seen(np.array(clip_from_object), sides), group.opacity, anew):
            return
    count = drawn_count(buffers.disc_count, group.share, group.moving_share, moving)
    count = points_while_moving(count, device) if moving else count
    scale = group.size * scale_px(view.window_matrix, context.region.height)
    buffers.discs.draw(count, clip_from_object, sides, scale, group.opacity)


_overlay = Overlay(draw, "POST_VIEW")


def register() -> None:
    """Start drawing."""
    _overlay.register()


def unregister() -> None:
    """Stop drawing and let go of what is on the graphics card."""
    _overlay.unregister()
    if bpy.app.timers.is_registered(_redraw_at_rest):
        bpy.app.timers.unregister(_redraw_at_rest)
    _buffers.clear()
    _motion.clear()
    for drawing in (gaussian_splats, splat_discs):
        drawing.forget_shaders()
