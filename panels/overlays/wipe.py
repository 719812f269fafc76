"""Two pictures in the camera's frame with a divider between them."""

import bpy
import gpu
import numpy as np

from ...r2sego_blender.bridge.asset.asset_frame import camera_frame_px
from ...r2sego_blender.bridge.asset.asset_pictures import is_of_view
from ...r2sego_blender.core.colours import linear_from_srgb
from .flat_shapes import rectangle, text_width, write
from .overlay import Overlay
from .textures import draw_texture, forget_shader

_TEXTURES = 4
"""So many pictures stay on the graphics card."""

_DIVIDER = (1.0, 1.0, 1.0, 0.9)
_MARGIN_PX, _TEXT_PX = 8.0, 12.0

_textures: dict[tuple, "gpu.types.GPUTexture"] = {}


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
        pixels[3::4] = 1.0
        data = gpu.types.Buffer("FLOAT", len(pixels), pixels)
        _textures[key] = gpu.types.GPUTexture((width, height), format="RGBA16F", data=data)
    return _textures[key]


def draw(context: bpy.types.Context) -> None:
    """Draw the comparison where the view looks through the scene's camera."""
    group = context.scene.r2sego_asset
    if not group.compare:
        return
    frame = camera_frame_px(context)
    if frame is None:
        return
    left, bottom, width, height = frame
    on_left, on_right = pictures = compared(context.scene)
    if not any(pictures):
        return
    for image, (begin, end) in zip(pictures, parts(group.wipe), strict=True):
        texture = _texture(image) if image is not None else None
        if texture is not None and begin < end:
            draw_texture(texture, frame, (begin, end))
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
    forget_shader()
