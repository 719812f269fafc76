"""Photographs of a room by Cycles. Needs pip's ``bpy``."""

from __future__ import annotations

from pathlib import Path

import bpy
from mathutils import Matrix

from demo.make_room import BLENDER_FROM_OPENCV, set_up_render
from r2sego_blender.core.cameras import Camera


def set_up(lens: Camera, samples: int) -> None:
    """Cycles as the demo's pictures are made, for one lens whose principal point is the middle."""
    set_up_render(samples)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = lens.width, lens.height
    scene.camera.data.lens = lens.fx * scene.camera.data.sensor_width / lens.width


def photograph(camera: Camera, file: Path) -> None:
    """Render one camera's PNG."""
    scene = bpy.context.scene
    scene.camera.matrix_world = Matrix((camera.world_from_camera @ BLENDER_FROM_OPENCV).tolist())
    output = scene.render.image_settings
    output.file_format, output.color_mode, output.compression = "PNG", "RGB", 60
    scene.render.filepath = str(file.resolve())
    bpy.ops.render.render(write_still=True)
