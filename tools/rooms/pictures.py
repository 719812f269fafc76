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


def render_exactly(threads: int = 0) -> None:
    """Pixels are the mean of what lies in them, all of as many samples; by ``threads`` threads, 0 for all."""
    scene = bpy.context.scene
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.filter_width = 1.0
    scene.render.threads_mode, scene.render.threads = ("FIXED", threads) if threads else ("AUTO", 1)


def photograph(camera: Camera, file: Path, seed: int | None = None) -> None:
    """Render one camera's PNG; ``seed`` is of Cycles' noise, by default that of all pictures."""
    scene = bpy.context.scene
    if seed is not None:
        scene.cycles.seed = seed
    scene.camera.matrix_world = Matrix((camera.world_from_camera @ BLENDER_FROM_OPENCV).tolist())
    output = scene.render.image_settings
    output.file_format, output.color_mode, output.compression = "PNG", "RGB", 60
    scene.render.filepath = str(file.resolve())
    bpy.ops.render.render(write_still=True)
