"""Two pictures in the camera's frame with a divider between them."""

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..r2sego_blender.bridge.asset_frame import camera_frame_px
from ..r2sego_blender.bridge.asset_pictures import is_of_view
from ..r2sego_blender.colours import linear_from_srgb
from .flat_shapes import rectangle, text_width, write
from .overlays import Overlay

_TEXTURES = 4
"""So many pictures stay on the graphics card."""

_DIVIDER = (1.0, 1.0, 1.0, 0.9)
_MARGIN_PX, _TEXT_PX = 8.0, 12.0

_VERTEX = """
void main()
{
  place = texCoord;
  gl_Position = ModelViewProjectionMatrix * vec4(pos, 1.0);
}
"""

_FRAGMENT = """
void main()
{
  fragColour = vec4(texture(picture, place).rgb, 1.0);
}
"""

_textures: dict[tuple, "gpu.types.GPUTexture"] = {}
_shaders: list["gpu.types.GPUShader"] = []


def parts(wipe: float) -> tuple[tuple[float, float], ...]:
    """For the left and the right picture: from which share of the frame's width to which."""
    return ((0.0, wipe), (wipe, 1.0))


def compared(scene: bpy.types.Scene) -> tuple[bpy.types.Image | None, bpy.types.Image | None]:
    """The left and the right picture, None for one that is of another view than the scene's camera has."""
    group = scene.r2sego_asset
    chosen = (group.wipe_left, group.wipe_right)
    left, right = (one if one is not None and is_of_view(one, scene.camera) else None for one in chosen)
    return left, right


def _texture(image: bpy.types.Image) -> "gpu.types.GPUTexture | None":
    """An sRGB image as the values to be drawn; None for one without pixels."""
    width, height = image.size
    key = (image.session_uid, width, height, image.filepath, image.name)
    if key not in _textures:
        if width * height == 0 or image.channels != 4:
            return None
        while len(_textures) >= _TEXTURES:
            _textures.pop(next(iter(_textures)))
        pixels = np.empty(4 * width * height, np.float32)
        image.pixels.foreach_get(pixels)
        if not image.is_float:  # whose values are linear already
            pixels.reshape(-1, 4)[:, :3] = linear_from_srgb(pixels.reshape(-1, 4)[:, :3])
        data = gpu.types.Buffer("FLOAT", len(pixels), pixels)
        _textures[key] = gpu.types.GPUTexture((width, height), format="RGBA16F", data=data)
    return _textures[key]


def _shader() -> "gpu.types.GPUShader":
    """Draws a texture as it is; Blender's own for images differ from version to version."""
    if not _shaders:
        info = gpu.types.GPUShaderCreateInfo()
        info.push_constant("MAT4", "ModelViewProjectionMatrix")
        info.sampler(0, "FLOAT_2D", "picture")
        info.vertex_in(0, "VEC3", "pos")
        info.vertex_in(1, "VEC2", "texCoord")
        between = gpu.types.GPUStageInterfaceInfo("r2sego_wipe")
        between.smooth("VEC2", "place")
        info.vertex_out(between)
        info.fragment_out(0, "VEC4", "fragColour")
        info.vertex_source(_VERTEX)
        info.fragment_source(_FRAGMENT)
        _shaders.append(gpu.shader.create_from_info(info))
    return _shaders[0]


def _draw_part(texture, frame: tuple[float, float, float, float], begin: float, end: float) -> None:
    """Draw the part of a picture between two shares of the frame's width."""
    if end <= begin:
        return
    left, bottom, width, height = frame
    x0, x1, top = left + begin * width, left + end * width, bottom + height
    shader = _shader()
    corners = ((x0, bottom, 0.0), (x1, bottom, 0.0), (x1, top, 0.0), (x0, top, 0.0))
    places = ((begin, 0.0), (end, 0.0), (end, 1.0), (begin, 1.0))
    batch = batch_for_shader(
        shader, "TRIS", {"pos": corners, "texCoord": places}, indices=((0, 1, 2), (0, 2, 3))
    )
    shader.bind()
    seen = gpu.matrix.get_projection_matrix() @ gpu.matrix.get_model_view_matrix()
    shader.uniform_float("ModelViewProjectionMatrix", seen)
    shader.uniform_sampler("picture", texture)
    batch.draw(shader)


def draw(context: bpy.types.Context) -> None:
    """Draw the comparison where the view looks through the scene's camera."""
    group = context.scene.r2sego_asset
    if not group.compare:
        return
    frame = camera_frame_px(context.scene, context.region, context.region_data)
    if frame is None:
        return
    left, bottom, width, height = frame
    on_left, on_right = pictures = compared(context.scene)
    if not any(pictures):
        return
    for image, (begin, end) in zip(pictures, parts(group.wipe), strict=True):
        texture = _texture(image) if image is not None else None
        if texture is not None:
            _draw_part(texture, frame, begin, end)
    scale = context.preferences.system.ui_scale
    margin, size = _MARGIN_PX * scale, _TEXT_PX * scale
    rectangle(left + group.wipe * width - scale, bottom, 2.0 * scale, height, _DIVIDER)
    if on_left is not None:
        write(on_left.name, left + margin, bottom + margin, size_px=size)
    if on_right is not None:
        right = left + width - text_width(on_right.name, size) - margin
        write(on_right.name, right, bottom + margin, size_px=size)


_overlay = Overlay(draw, "POST_PIXEL")


def register() -> None:
    """Start drawing."""
    _overlay.register()


def unregister() -> None:
    """Stop drawing and let go of the pictures."""
    _overlay.unregister()
    _textures.clear()
    _shaders.clear()
