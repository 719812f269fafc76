"""Make a scene bundle from photographs, with every choice of New Scene, and say what it holds.

blender --background --python batch/examples/scene_new.py -- room.r2s --captures FOLDER --poses cameras.json
python batch/examples/scene_new.py -- room.r2s --captures FOLDER --camera-height 1.45  (pip bpy)
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon, require_in_range

from r2sego_blender.commands.scripts import run_script


def main(arguments: list[str]) -> int:
    """Make the bundle and tell; returns 0."""
    parser = argparse.ArgumentParser(prog="scene_new.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path, help="the bundle to make, a folder that ends in .r2s")
    parser.add_argument("--captures", type=Path, required=True, help="folder of photographs")
    parser.add_argument("--poses", type=Path, help="their cameras; solved when left out")
    parser.add_argument("--robot", help="embedded:humanoid, embedded:wheeled, or an MJCF or URDF file")
    parser.add_argument("--scope", help="a shipped behaviour scope, or a TOML file")
    scale = parser.add_mutually_exclusive_group()
    scale.add_argument("--camera-height", type=float, help="of the first photograph's camera, metres")
    scale.add_argument("--marker-side", type=float, help="of a printed ArUco 4x4_50 marker, metres")
    scale.add_argument("--known-length", metavar="PHOTO:X,Y:X,Y:METRES")
    scale.add_argument("--depth", type=Path, help="folder of depth maps, called as the photographs")
    options = parser.parse_args(arguments)
    given = {"filepath": str(options.scene.absolute()), "captures": str(options.captures.absolute())}
    given |= {"poses": str(options.poses.absolute())} if options.poses else {}
    for choice in ("robot", "scope"):
        given |= {choice: value} if (value := getattr(options, choice)) else {}
    for choice, kind in (
        ("camera_height", "CAMERA_HEIGHT"),
        ("marker_side", "MARKER"),
        ("known_length", "KNOWN_LENGTH"),
    ):
        given |= {choice: value, "scale": kind} if (value := getattr(options, choice)) is not None else {}
    given |= {"depth": str(options.depth.absolute()), "scale": "DEPTH"} if options.depth else {}
    with enabled_addon():
        require_in_range("new_scene", **given)
        bpy.ops.r2sego.new_scene(**given)
        for fact in bpy.context.scene.r2sego.facts:
            print(f"{fact.section}, {fact.label}: {fact.value}")
        for one in bpy.context.scene.r2sego_captures.captures:
            print(f"{one.name}: {one.width}x{one.height}, {one.points} points")
    return 0


if __name__ == "__main__":
    run_script(main)
