"""Structural conditions in Cycles: what the proxy looks like along a camera path."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import bpy

from ..cameras import Camera
from ..geometry.proxy import GeometryProxy
from . import versions
from .cameras import create_camera, object_pose, use_frame_of
from .outliner import clear
from .show_proxy import proxy_mesh

# The ray of every pixel goes through its centre: an antialiased depth has flying points.
_CENTRE_FILTER = 0.01


def render_conditions(proxy: GeometryProxy, path: Sequence[Camera], folder: Path) -> list[Path]:
    """Render ``proxy`` from every camera of ``path``, all with one lens.

    Writes, for frame n from 1, ``depth_000n.exr`` (planar z, metres), ``normal_000n.exr``
    (world frame) and ``provenance_000n.exr`` (0 = nothing seen, so it is the validity
    mask, else ``Provenance`` + 1) in 32-bit floats. Returns them in the order written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    scene = bpy.data.scenes.new("R2S-EGO conditions")
    try:
        mesh = proxy_mesh(proxy, scene.name)
        scene.collection.objects.link(bpy.data.objects.new(scene.name, mesh))
        _animate(scene, path)
        _settle(scene)
        versions.write_passes(
            scene, folder,
            {"depth": "Depth", "normal": "Normal", "provenance": versions.MATERIAL_INDEX_PASS},
        )  # fmt: skip
        # An animation always writes the combined image too; nobody wants it.
        with tempfile.TemporaryDirectory(prefix="r2sego-") as unwanted:
            scene.render.filepath = str(Path(unwanted, "image_"))
            bpy.ops.render.render(animation=True, scene=scene.name)
    finally:
        versions.remove_passes(scene)
        clear(scene.collection)
        bpy.data.scenes.remove(scene)
    frames = range(1, len(path) + 1)
    return [folder / f"{name}_{n:04d}.exr" for n in frames for name in ("depth", "normal", "provenance")]


def _animate(scene: bpy.types.Scene, path: Sequence[Camera]) -> None:
    camera = create_camera("R2S-EGO path", path[0])
    scene.collection.objects.link(camera)
    use_frame_of(camera, scene)
    camera.rotation_mode = "QUATERNION"
    for frame, view in enumerate(path, start=1):
        camera.matrix_world = object_pose(view.world_from_camera).T.tolist()
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_quaternion", frame=frame)
    scene.frame_start, scene.frame_end = 1, len(path)


def _settle(scene: bpy.types.Scene) -> None:
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 1
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 0
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.filter_width = _CENTRE_FILTER
    scene.render.use_motion_blur = False
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = layer.use_pass_material_index = True
