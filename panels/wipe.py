"""Two pictures in the camera's frame with a divider between them."""

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..r2sego_blender.bridge.asset_frame import camera_frame_px
from .flat_shapes import rectangle, text_width, write
from .overlays import Overlay

_TEXTURES = 4
"""So many pictures stay on the graphics card."""

_DIVIDER = (1.0, 1.0, 1.0, 0.9)
_MARGIN_PX = 8.0

_textures: dict[tuple, "gpu.types.GPUTexture"] = {}


def parts(wipe: float) -> tuple[tuple[float, float], ...]:
    """For the left and the right picture: from which share of the frame's width to which."""
    return ((0.0, wipe), (wipe, 1.0))


def _texture(image: bpy.types.Image) -> "gpu.types.GPUTexture | None":
    """The image's own sRGB values, as they are in the file; None for one without pixels."""
    width, height = image.size
    key = (image.session_uid, width, height, image.filepath, image.name)
    if key not in _textures:
        if width * height == 0 or image.channels != 4:
            return None
        while len(_textures) >= _TEXTURES:
            _textures.pop(next(iter(_textures)))
        pixels = np.empty(4 * width * height, np.float32)
        image.pixels.foreach_get(pixels)
        data = gpu.types.Buffer("FLOAT", len(pixels), pixels)
        _textures[key] = gpu.types.GPUTexture((width, height), format="RGBA16F", data=data)
    return _textures[key]


def _draw_part(texture, frame: tuple[float, float, float, float], begin: float, end: float) -> None:
    """Draw the part of a picture between two shares of the frame's width."""
    if end <= begin:
        return
    left, bottom, width, height = frame
    x0, x1, top = left + begin * width, left + end * width, bottom + height
    shader = gpu.shader.from_builtin("IMAGE")
    corners = ((x0, bottom, 0.0), (x1, bottom, 0.0), (x1, top, 0.0), (x0, top, 0.0))
    places = ((begin, 0.0), (end, 0.0), (end, 1.0), (begin, 1.0))
    batch = batch_for_shader(
        shader, "TRIS", {"pos": corners, "texCoord": places}, indices=((0, 1, 2), (0, 2, 3))
    )
    shader.bind()
    shader.uniform_sampler("image", texture)
    batch.draw(shader)


def draw(context: bpy.types.Context) -> None:
    """Draw the comparison where the view looks through the scene's camera."""
    group = context.scene.r2sego_asset
    if not group.compare or (group.wipe_left is None and group.wipe_right is None):
        return
    frame = camera_frame_px(context.scene, context.region, context.region_data)
    if frame is None:
        return
    left, bottom, width, height = frame
    pictures = (group.wipe_left, group.wipe_right)
    for image, (begin, end) in zip(pictures, parts(group.wipe), strict=True):
        texture = _texture(image) if image is not None else None
        if texture is not None:
            _draw_part(texture, frame, begin, end)
    rectangle(left + group.wipe * width - 1.0, bottom, 2.0, height, _DIVIDER)
    line = bottom + _MARGIN_PX
    if group.wipe_left is not None:
        write(group.wipe_left.name, left + _MARGIN_PX, line)
    if group.wipe_right is not None:
        name = group.wipe_right.name
        write(name, left + width - text_width(name) - _MARGIN_PX, line)


_overlay = Overlay(draw, "POST_PIXEL")


def register() -> None:
    """Start drawing."""
    _overlay.register()


def unregister() -> None:
    """Stop drawing and let go of the pictures."""
    _overlay.unregister()
    _textures.clear()
