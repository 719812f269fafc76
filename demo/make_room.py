"""Build the demo living room and render its captures and frozen robot views.

    python demo/make_room.py [--out DIR] [--samples N] [--only NAME ...] [--blend FILE]
    blender --background --python demo/make_room.py -- [the same options]

The first form needs pip's ``bpy``. The pictures are the same on every run of one Blender
version: the seed is fixed and Cycles renders on the CPU.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree

sys.path.insert(0, str(Path(__file__).resolve().parent))

from living_room import cameras
from living_room.architecture import add_shell, add_west_curtain
from living_room.decoration import add_decoration
from living_room.furniture import add_furniture
from living_room.lights import add_lights
from living_room.materials import make_palette

SEED = 11
LARGEST_PNG_BYTES = 500_000
"""Larger pictures are kept as lossless WebP, so that the shipped room stays below 10 MB."""

ROBOT_RADIUS_M = 0.16
"""Half the width of the body that has to fit under every frozen view."""

BLENDER_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])


def main() -> None:
    """Build, check and render the room."""
    options = parse_options()
    build_room()
    set_up_render(options.samples)
    require_free_standing(cameras.frozen_views())
    if options.blend:
        bpy.ops.wm.save_as_mainfile(filepath=str(options.blend.resolve()))
    render_all(options.out, options.only)


def parse_options() -> argparse.Namespace:
    """The options after ``--`` under Blender, or all of them under plain Python."""
    if "--" in sys.argv:
        arguments = sys.argv[sys.argv.index("--") + 1 :]
    else:
        arguments = sys.argv[1:] if bpy.app.module else []
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parent / "room")
    parser.add_argument("--samples", type=int, default=10, help="Cycles samples a pixel")
    parser.add_argument("--only", nargs="*", help="names of the views to render, such as capture_02")
    parser.add_argument("--blend", type=Path, help="also save the room as this .blend file")
    return parser.parse_args(arguments)


def build_room() -> None:
    """The whole scene, from an empty file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    rng = np.random.default_rng(SEED)
    palette = make_palette(SEED)
    add_shell(palette)
    add_west_curtain(palette)
    add_furniture(palette, rng)
    add_decoration(palette, rng)
    add_lights()


def set_up_render(samples: int) -> None:
    """Cycles on the CPU with a fixed seed, denoised, and the one lens of all views."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = cameras.WIDTH_PX, cameras.HEIGHT_PX
    scene.render.resolution_percentage = 100
    scene.render.use_persistent_data = True
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.seed = SEED
    scene.cycles.use_denoising = True
    scene.cycles.denoiser = "OPENIMAGEDENOISE"
    scene.cycles.use_adaptive_sampling = True
    scene.cycles.adaptive_min_samples = 8
    scene.cycles.adaptive_threshold = 0.08
    scene.cycles.max_bounces = 4
    scene.cycles.diffuse_bounces = 3
    scene.cycles.glossy_bounces = 2
    scene.cycles.caustics_reflective = scene.cycles.caustics_refractive = False
    scene.cycles.sample_clamp_indirect = 6.0
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "AgX - Medium High Contrast"
    scene.view_settings.exposure = 0.35
    lens = bpy.data.cameras.new("lens")
    lens.sensor_width = 36.0
    lens.lens = cameras.FOCAL_PX * lens.sensor_width / cameras.WIDTH_PX
    lens.clip_start = 0.02
    scene.camera = bpy.data.objects.new("camera", lens)
    scene.collection.objects.link(scene.camera)


def require_free_standing(views: list[cameras.View]) -> None:
    """Stop if a robot standing under one of the views would be inside furniture."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    trees = []
    for part in bpy.context.scene.objects:
        if part.type == "MESH" and not part.name.startswith("rug"):
            trees.append((part, BVHTree.FromObject(part, depsgraph)))
    for view in views:
        x, y, top = view.world_from_camera[:3, 3]
        for height in np.arange(0.25, top + 0.1, 0.08):
            for part, tree in trees:
                world_from_part = part.evaluated_get(depsgraph).matrix_world
                local = world_from_part.inverted() @ Vector((x, y, height))
                _, _, _, distance = tree.find_nearest(local, ROBOT_RADIUS_M)
                if distance is not None:
                    raise SystemExit(f"{view.name}: {part.name} is {distance:.2f} m away at {height:.2f} m height")


def render_all(folder: Path, only: list[str] | None) -> None:
    """Render every view into ``folder``; write cameras.json unless only some were asked for."""
    files = {"captures": {}, "frozen": {}}
    for kind, views in (("captures", cameras.captures()), ("frozen", cameras.frozen_views())):
        (folder / kind).mkdir(parents=True, exist_ok=True)
        for view in views:
            if only and view.name not in only:
                continue
            started_s = time.monotonic()
            path = render(view, folder / kind)
            print(f"{path} in {time.monotonic() - started_s:.1f} s", flush=True)
            files[kind][f"{kind}/{path.name}"] = view
    if not only:
        cameras.write_cameras(folder / "cameras.json", files["captures"], files["frozen"])


def render(view: cameras.View, folder: Path) -> Path:
    """One picture: a PNG, or the same pixels as WebP where the PNG would be large."""
    scene = bpy.context.scene
    scene.camera.matrix_world = Matrix((view.world_from_camera @ BLENDER_FROM_OPENCV).tolist())
    output = scene.render.image_settings
    output.file_format, output.color_mode, output.compression = "PNG", "RGB", 100
    path = folder / f"{view.name}.png"
    path.with_suffix(".webp").unlink(missing_ok=True)
    scene.render.filepath = str(path.resolve())
    bpy.ops.render.render(write_still=True)
    if path.stat().st_size <= LARGEST_PNG_BYTES:
        return path
    path.unlink()
    output.file_format, output.quality = "WEBP", 100  # 100 is lossless
    path = path.with_suffix(".webp")
    bpy.data.images["Render Result"].save_render(str(path.resolve()), scene=scene)
    return path


if __name__ == "__main__":
    main()
