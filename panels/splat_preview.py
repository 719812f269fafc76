"""The asset's splats in the 3D views: round discs of their colour and size, hidden by what is nearer.

Nothing is sorted. The discs write depth, and a disc that lets light through leaves pixels out by
chance, so the order does not matter. The splats lie in the buffer in a random order: a part of it is
an even part of them, and that is what is drawn while the view moves or the timeline runs.
"""

import time

import bpy
import gpu
import numpy as np

from ..r2sego_blender.bridge.show_asset import DrawnSplats, drawn_splats, is_deleted
from ..r2sego_blender.bridge.views_3d import redraw_views
from ..r2sego_blender.colours import linear_from_srgb
from .overlays import Overlay, points_while_moving, timeline_runs

_SETTLED_S = 0.25
"""The view is at rest when it has not moved for so long."""

_LARGEST_PX = 48.0
_FALLBACK_PX = 3.0
_MARKED = (1.0, 0.15, 0.1)
_FAINT = 0.05
"""Splats less opaque than this are not drawn."""

_VERTEX = """
void main()
{
  gl_Position = viewProjection * vec4(pos, 1.0);
  gl_PointSize = clamp(2.0 * radius * scale / gl_Position.w, 1.0, largest);
  splatColour = vec4(color.rgb, color.a * opacity);
}
"""

_FRAGMENT = """
void main()
{
  vec2 at = 2.0 * gl_PointCoord - 1.0;
  float square = dot(at, at);
  if (square > 1.0) {
    discard;
  }
  float chance = fract(sin(dot(gl_FragCoord.xyz, vec3(12.9898, 78.233, 37.719))) * 43758.5453);
  if (splatColour.a < chance) {
    discard;
  }
  fragColour = vec4(splatColour.rgb, 1.0);
}
"""


class SplatBuffer:
    """The splats of one mesh on the graphics card, as of one revision of their marks."""

    def __init__(self, splats: DrawnSplats, backdrop: bool) -> None:
        chosen = drawn_order(splats, backdrop)
        self.count = len(chosen)
        form = gpu.types.GPUVertFormat()
        form.attr_add(id="pos", comp_type="F32", len=3, fetch_mode="FLOAT")
        form.attr_add(id="color", comp_type="F32", len=4, fetch_mode="FLOAT")
        form.attr_add(id="radius", comp_type="F32", len=1, fetch_mode="FLOAT")
        vertices = gpu.types.GPUVertBuf(form, self.count)
        vertices.attr_fill("pos", np.ascontiguousarray(splats.means[chosen]))
        vertices.attr_fill("color", colours_of(splats)[chosen])
        vertices.attr_fill("radius", np.ascontiguousarray(splats.radii_m[chosen, None]))
        self._batch = gpu.types.GPUBatch(type="POINTS", buf=vertices)

    def draw(self, count: int, shader) -> None:
        """Draw the first ``count`` of them."""
        self._batch.draw_range(shader, elem_start=0, elem_count=count)


def drawn_order(splats: DrawnSplats, backdrop: bool) -> np.ndarray:
    """(M,) indices of the splats worth drawing, in an order of which each part is an even sample.

    Marked splats come first, so that they are seen however few are drawn.
    """
    worth = splats.opacities >= _FAINT
    if not backdrop:
        worth &= ~splats.backdrop
    order = np.random.default_rng(0).permutation(np.flatnonzero(worth))
    return order[np.argsort(~splats.marked[order], kind="stable")]


def colours_of(splats: DrawnSplats) -> np.ndarray:
    """(N, 4) float32: linear colour and opacity; marked splats are red and opaque."""
    srgb = splats.colours.copy()
    srgb[splats.marked] = 0.3 * srgb[splats.marked] + 0.7 * np.float32(_MARKED)
    opacities = np.where(splats.marked, 1.0, splats.opacities)
    return np.concatenate([linear_from_srgb(srgb), opacities[:, None]], axis=1).astype(np.float32)


def drawn_count(total: int, share: float, moving_share: float, moving: bool) -> int:
    """How many of ``total`` splats are drawn."""
    return min(total, max(1, round(total * share * (moving_share if moving else 1.0))))


def scale_px(window_matrix: np.ndarray, height: int) -> float:
    """Pixels of a metre seen one metre away, or anywhere in a view with parallel rays."""
    return float(window_matrix[1][1]) * height / 2.0


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
_buffers: dict[tuple, SplatBuffer] = {}
"""The one buffer that was drawn last, by mesh, revision and choice."""
_shaders: list = []


def _buffer(shown: bpy.types.Object, group: bpy.types.PropertyGroup) -> SplatBuffer | None:
    mesh = shown.data
    key = (mesh.session_uid, len(mesh.vertices), group.revision, group.backdrop)
    if key not in _buffers:
        _buffers.clear()
        if mesh.is_editmode:  # its attributes cannot be read; Edit Mode shows its own points
            return None
        splats = drawn_splats(mesh)
        if splats is None or not len(drawn_order(splats, group.backdrop)):
            return None
        _buffers[key] = SplatBuffer(splats, group.backdrop)
    return _buffers[key]


def _let_go_of_deleted() -> None:
    """Free the splats of an object that no Blender scene has any more; the graphics card is small."""
    shown = (scene.r2sego_asset.shown for scene in bpy.data.scenes)
    kept = {one.data.session_uid for one in shown if one is not None and not is_deleted(one)}
    for key in [key for key in _buffers if key[0] not in kept]:
        del _buffers[key]


def _shader() -> tuple:
    """The discs' shader, or the plain points' of a Blender that refuses it; and which it is."""
    if not _shaders:
        try:
            _shaders.append((_disc_shader(), True))
        except Exception as error:  # what a driver refuses differs; an overlay must not raise
            print(f"R2S-EGO: splats are drawn as plain points: {error}")
            _shaders.append((gpu.shader.from_builtin("FLAT_COLOR"), False))
    return _shaders[0]


def _disc_shader():
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("MAT4", "viewProjection")
    for name in ("scale", "largest", "opacity"):
        info.push_constant("FLOAT", name)
    info.vertex_in(0, "VEC3", "pos")
    info.vertex_in(1, "VEC4", "color")
    info.vertex_in(2, "FLOAT", "radius")
    between = gpu.types.GPUStageInterfaceInfo("r2sego_splat")
    between.flat("VEC4", "splatColour")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "fragColour")
    info.vertex_source(_VERTEX)
    info.fragment_source(_FRAGMENT)
    return gpu.shader.create_from_info(info)


def draw(context: bpy.types.Context) -> None:
    """Draw the shown asset into the current 3D view."""
    _let_go_of_deleted()
    group = context.scene.r2sego_asset
    shown = group.shown
    if not group.preview or shown is None or shown.mode == "EDIT":
        return
    if not shown.visible_get(viewport=context.space_data):
        return
    buffer = _buffer(shown, group)
    if buffer is None:
        return
    view = context.region_data
    world = view.perspective_matrix @ shown.matrix_world
    moving = _motion.moving(context.region.as_pointer(), tuple(value for row in world for value in row))
    moving |= timeline_runs(context)
    count = drawn_count(buffer.count, group.share, group.moving_share, moving)
    count = points_while_moving(count, gpu.platform.device_type_get()) if moving else count
    shader, discs = _shader()
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(True)
    shader.bind()
    if discs:
        gpu.state.program_point_size_set(True)
        shader.uniform_float("viewProjection", world)
        shader.uniform_float("scale", group.size * scale_px(view.window_matrix, context.region.height))
        shader.uniform_float("largest", _LARGEST_PX)
        shader.uniform_float("opacity", group.opacity)
        buffer.draw(count, shader)
        gpu.state.program_point_size_set(False)
    else:
        gpu.state.point_size_set(_FALLBACK_PX)
        buffer.draw(count, shader)
    gpu.state.depth_mask_set(False)
    gpu.state.depth_test_set("NONE")


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
    _shaders.clear()
    _motion.clear()
