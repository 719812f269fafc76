"""Splats in a 3D view as opaque round discs of their colour and size, hidden by what is nearer.

Nothing is sorted. The discs write depth, and a disc that lets light through leaves pixels out by
chance, so the order does not matter. The splats lie in the buffer in a random order: a part of it is
an even part of them.
"""

import gpu
import numpy as np

from ...r2sego_blender.bridge.asset.show_asset import DrawnSplats
from ...r2sego_blender.core.colours import linear_from_srgb
from .clipping_region import ClippedPoints

_LARGEST_PX = 48.0
_FALLBACK_PX = 3.0

_VERTEX = """
void main()
{
  gl_Position = clipFromObject * vec4(pos, 1.0);
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

_shaders: list = []


class SplatDiscs:
    """Splats on the graphics card, to be drawn as discs.

    ``colours`` (N, 4) are sRGB and opacity; of ``splats`` only the ``chosen`` (M,) are kept, in
    their order.
    """

    def __init__(self, splats: DrawnSplats, colours: np.ndarray, chosen: np.ndarray) -> None:
        form = gpu.types.GPUVertFormat()
        form.attr_add(id="pos", comp_type="F32", len=3, fetch_mode="FLOAT")
        form.attr_add(id="color", comp_type="F32", len=4, fetch_mode="FLOAT")
        form.attr_add(id="radius", comp_type="F32", len=1, fetch_mode="FLOAT")
        vertices = gpu.types.GPUVertBuf(form, len(chosen))
        linear = np.concatenate([linear_from_srgb(colours[chosen, :3]), colours[chosen, 3:]], axis=1)
        places = np.ascontiguousarray(splats.means[chosen])
        vertices.attr_fill("pos", places)
        vertices.attr_fill("color", np.ascontiguousarray(linear))
        vertices.attr_fill("radius", np.ascontiguousarray(splats.radii_m[chosen, None]))
        self._points = ClippedPoints(vertices, places)

    def draw(
        self, count: int, clip_from_object, kept_sides: np.ndarray | None, scale_px: float, opacity: float
    ) -> None:
        """Draw the first ``count`` of those on the sides of planes in the object that ``kept_sides`` tell.

        ``scale_px`` is as its function gives it, times the discs' size.
        """
        shader, discs = _shader()
        gpu.state.depth_test_set("LESS_EQUAL")
        gpu.state.depth_mask_set(True)
        shader.bind()
        if discs:
            gpu.state.program_point_size_set(True)
            shader.uniform_float("clipFromObject", clip_from_object)
            shader.uniform_float("scale", scale_px)
            shader.uniform_float("largest", _LARGEST_PX)
            shader.uniform_float("opacity", opacity)
        else:
            gpu.state.point_size_set(_FALLBACK_PX)
        self._points.draw(shader, count, kept_sides)
        if discs:
            gpu.state.program_point_size_set(False)
        gpu.state.depth_mask_set(False)
        gpu.state.depth_test_set("NONE")


def drawn_count(total: int, share: float, moving_share: float, moving: bool) -> int:
    """How many of ``total`` splats are drawn."""
    return min(total, max(1, round(total * share * (moving_share if moving else 1.0))))


def scale_px(window_matrix: np.ndarray, height: int) -> float:
    """Pixels of a metre seen one metre away, or anywhere in a view with parallel rays."""
    return float(window_matrix[1][1]) * height / 2.0


def forget_shaders() -> None:
    """Let go of what is on the graphics card."""
    _shaders.clear()


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
    info.push_constant("MAT4", "clipFromObject")
    for name in ("scale", "largest", "opacity"):
        info.push_constant("FLOAT", name)
    info.vertex_in(0, "VEC3", "pos")
    info.vertex_in(1, "VEC4", "color")
    info.vertex_in(2, "FLOAT", "radius")
    between = gpu.types.GPUStageInterfaceInfo("r2sego_disc")
    between.flat("VEC4", "splatColour")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "fragColour")
    info.vertex_source(_VERTEX)
    info.fragment_source(_FRAGMENT)
    return gpu.shader.create_from_info(info)
