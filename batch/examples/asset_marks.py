"""Count what floats in an asset by several limits, mark floaters and boxes, and delete them if asked.

blender --background --python batch/examples/asset_marks.py -- SCENE [--distance 0.1 --fewest 5]
python batch/examples/asset_marks.py -- SCENE --box 0 0 2 0.5 0.5 0.2 --delete ceiling  (pip bpy)
"""

import argparse
import contextlib
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon, require_in_range

from r2sego_blender.commands.scripts import run_script


def main(arguments: list[str]) -> int:
    """Count, mark, and delete if asked; returns 0."""
    parser = argparse.ArgumentParser(prog="asset_marks.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--round", default="final", help="initial, a round from 0, or final")
    parser.add_argument("--distance", type=float, default=0.1, help="how far around others count, metres")
    parser.add_argument("--fewest", type=int, default=0, help="mark splats with fewer than these around")
    parser.add_argument("--faint", type=float, default=0.0, help="mark splats less opaque than this")
    parser.add_argument("--large", type=float, default=0.0, help="mark splats of a larger radius, metres")
    parser.add_argument(
        "--box",
        type=float,
        nargs=6,
        action="append",
        default=[],
        metavar="M",
        help="mark a box: its middle, and from there to its sides",
    )
    parser.add_argument("--delete", metavar="NAME", help="delete what is marked, under this name")
    options = parser.parse_args(arguments)
    with enabled_addon():
        r2sego, scene = bpy.ops.r2sego, bpy.context.scene
        r2sego.open_scene(directory=str(options.scene.absolute()))
        r2sego.show_asset(stage=options.round)
        for fewest in (2, 5, 10):
            print(
                f"{floaters(distance=options.distance, fewest=fewest)} splats have fewer than {fewest} "
                f"within {options.distance:g} m"
            )
            if len(scene.r2sego_asset.marks):
                r2sego.clear_splat_marks()
        if options.fewest or options.faint or options.large:
            limits = {name: getattr(options, name) for name in ("distance", "fewest", "faint", "large")}
            print(f"{floaters(**limits)} floaters are marked")
        for *middle, x, y, z in options.box:
            scene.cursor.location = middle
            r2sego.add_splat_box(half_extents=(x, y, z))  # the active object then
            r2sego.mark_splats_box()
        print(f"{scene.r2sego_asset.marked} splats are marked in {len(scene.r2sego_asset.marks)} regions")
        if options.delete:
            r2sego.delete_splats(name=options.delete)
        for edit in scene.r2sego_asset.edits:
            print(f"deleted in {edit.name}: {edit.regions}")
    return 0


def floaters(**limits) -> int:
    """Mark what floats by these limits; how many splats are marked then."""
    require_in_range("mark_floaters", **limits)
    with contextlib.suppress(RuntimeError):  # none does
        bpy.ops.r2sego.mark_floaters(**limits)
    return bpy.context.scene.r2sego_asset.marked


if __name__ == "__main__":
    run_script(main)
