"""A clip's frames as one image sequence, behind the camera that saw them: generated ones, and a head's."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy

from ...core.errors import GenerationError, R2SEgoError
from ...core.image_sizes import require_sensible_png
from .image_editors import image_editors

_CLIP = "r2sego_clip"


def clip_image(name: str, files: Sequence[Path], error: type[R2SEgoError] = GenerationError) -> bpy.types.Image:
    """The frames, numbered without a gap, as the image sequence of this name, in place of those of before.

    Raises ``error`` for one that is no PNG, or of more pixels than is sensible.
    """
    for file in files:
        require_sensible_png(file, error)
    remove_clips(name)
    image = bpy.data.images.load(str(files[0]), check_existing=False)
    image.name, image[_CLIP] = name, name
    image.source = "SEQUENCE"
    return image


def remove_clips(name: str) -> None:
    """Remove the image sequences of this name, but for one behind a camera: another Blender scene plays it, or a
    copy that is a person's own."""
    played = {one.image for camera in bpy.data.cameras for one in camera.background_images}
    of_name = [image for image in bpy.data.images if image.get(_CLIP, image.name) == name]
    bpy.data.batch_remove([image for image in of_name if image.library is None and image not in played])


def put_behind(camera: bpy.types.Object, image: bpy.types.Image, frames: int, first_frame: int) -> None:
    """Let the camera look through frame i of the sequence in frame ``first_frame + i``."""
    background = camera.data.background_images.new()
    background.image = image
    _play(background.image_user, frames, first_frame)
    background.alpha = 1.0
    background.frame_method = "STRETCH"
    background.display_depth = "FRONT"
    camera.data.show_background_images = True


def play_in_editor(image: bpy.types.Image, frames: int, first_frame: int) -> None:
    """Let every Image Editor that shows the sequence follow the timeline."""
    for _, area in image_editors():
        if area.spaces.active.image == image:
            _play(area.spaces.active.image_user, frames, first_frame)


def _play(user: bpy.types.ImageUser, frames: int, first_frame: int) -> None:
    user.frame_duration = frames
    user.frame_start = first_frame
    user.frame_offset = -1  # the files are numbered from 000
    user.use_auto_refresh = True
