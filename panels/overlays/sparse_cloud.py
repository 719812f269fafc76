"""The overlay of the triangulated points: drawn as they are, without objects, quick with 200 000."""

import gpu

from ...r2sego_blender.bridge.shared.moved_bundle import whole_path
from ...r2sego_blender.results.panels.sparse_cloud import cloud_at
from .clipping_region import ClippedPoints, kept_sides
from .overlay import Overlay, points_while_moving, timeline_runs

_VERTEX = """
void main() {
  gl_Position = perspective * vec4(pos, 1.0);
  gl_PointSize = size;
  shown = color;
}
"""
_FRAGMENT = """
void main() {
  outcome = shown;
}
"""
_made = {}

_MOST_WIDE = 60_000
"""Points wider than a pixel are filled one by one, which takes long without a GPU: so many at most."""


def _draw(context):
    scene = context.scene
    shown = getattr(scene, "r2sego_captures", None)
    if shown is None or not shown.show_cloud or not scene.r2sego.bundle or not _has_place(context.space_data):
        return
    cloud = cloud_at(whole_path(scene.r2sego.bundle))
    if cloud is None or not len(cloud.points):
        return
    if _made.get("cloud") is not cloud:  # to the GPU once, not once a frame
        _made["shader"] = _made.get("shader") or _shader()
        form = gpu.types.GPUVertFormat()
        form.attr_add(id="pos", comp_type="F32", len=3, fetch_mode="FLOAT")
        form.attr_add(id="color", comp_type="F32", len=4, fetch_mode="FLOAT")
        vertices = gpu.types.GPUVertBuf(form, len(cloud.points))
        vertices.attr_fill("pos", cloud.points)
        vertices.attr_fill("color", cloud.colours)
        _made["points"] = ClippedPoints(vertices, cloud.points)
        _made["cloud"] = cloud
    shader = _made["shader"]
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.program_point_size_set(True)
    shader.bind()
    shader.uniform_float("perspective", context.region_data.perspective_matrix)
    size_px = shown.point_size_px * context.preferences.system.ui_scale
    shader.uniform_float("size", size_px)
    drawn = len(cloud.points) if size_px <= 1.0 else min(len(cloud.points), _MOST_WIDE)
    if timeline_runs(context):
        drawn = points_while_moving(drawn, gpu.platform.device_type_get())
    _made["points"].draw(shader, drawn, kept_sides(context.region_data))
    gpu.state.program_point_size_set(False)
    gpu.state.depth_test_set("NONE")


def _has_place(space):
    """Whether a view shows overlays, and more than the objects of its Local View."""
    return space is not None and space.overlay.show_overlays and space.local_view is None


def _shader():
    between = gpu.types.GPUStageInterfaceInfo("r2sego_cloud")
    between.smooth("VEC4", "shown")
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("MAT4", "perspective")
    info.push_constant("FLOAT", "size")
    info.vertex_in(0, "VEC3", "pos")
    info.vertex_in(1, "VEC4", "color")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "outcome")
    info.vertex_source(_VERTEX)
    info.fragment_source(_FRAGMENT)
    return gpu.shader.create_from_info(info)


_overlay = Overlay(_draw, "POST_VIEW")


def register():
    """Start drawing."""
    _overlay.register()


def unregister():
    """Stop drawing, and let the GPU's copy go."""
    _overlay.unregister()
    _made.clear()
