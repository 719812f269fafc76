"""Renderings of the asset as Blender's images: loaded and put behind a camera."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np

from ...core.errors import SceneError

_RENDERED, _SEEN_FROM = "r2sego_rendered", "r2sego_seen_from"


def load_picture(file: Path, name: str) -> bpy.types.Image:
    """The image of this name, made of the file and packed, so that the .blend keeps it.

    Raises SceneError when the file is no image.
    """
    try:
        image = bpy.data.images.load(str(file))
        image.pack()
    except RuntimeError as error:
        raise SceneError(f"Blender cannot read the picture: {error}", where=file, cure="Render again.") from error
    before = bpy.data.images.get(name)
    if before is not None:
        before.user_remap(image)  # whatever shows the old one shows the new one
        bpy.data.images.remove(before)
    image.name, image[_RENDERED] = name, True
    return image


def pose_values(camera_object: bpy.types.Object) -> list[float]:
    """Where a camera stands, for ``note_pose``: its matrix without scale, row by row."""
    return [value for row in camera_object.matrix_world.normalized() for value in row]


def note_pose(image: bpy.types.Image, pose: Sequence[float]) -> None:
    """Keep with an image the pose (16,) of the camera whose view it shows."""
    image[_SEEN_FROM] = list(pose)


def is_of_view(image: bpy.types.Image, camera_object: bpy.types.Object | None) -> bool:
    """Whether an image may show what a camera sees: for all that is known it was taken from there."""
    noted = image.get(_SEEN_FROM)
    return noted is None or (
        camera_object is not None and np.allclose(list(noted), pose_values(camera_object), atol=1e-4)
    )


def photograph_of(camera_object: bpy.types.Object | None) -> bpy.types.Image | None:
    """The photograph a capture's camera looks through; None when it has none."""
    if camera_object is None or camera_object.type != "CAMERA":
        return None
    return next((background.image for background in photographs_behind(camera_object.data)), None)


def photographs_behind(data: bpy.types.Camera) -> list[bpy.types.CameraBackgroundImage]:
    """A camera's backgrounds that are neither renderings nor clips."""
    return [
        one
        for one in data.background_images
        if one.image is not None and one.image.source != "SEQUENCE" and not one.image.get(_RENDERED)
    ]


def put_behind(camera_object: bpy.types.Object, image: bpy.types.Image) -> None:
    """Show what ``load_picture`` loaded as the camera's background, over its photograph; one at a time."""
    data = camera_object.data
    background = next((b for b in data.background_images if b.image is not None and b.image.get(_RENDERED)), None)
    if background is None:
        background = data.background_images.new()
    background.image = image
    background.alpha = 1.0
    background.frame_method = "STRETCH"
    background.display_depth = "BACK"
    data.show_background_images = True
