"""Declare an object's outline as the behaviour region, and roll the behaviour out in it.

blender --background --python batch/examples/robot_region.py -- SCENE --blend room.blend --object rug
python batch/examples/robot_region.py -- SCENE --blend room.blend --object rug --run 0  (pip bpy)

The object is a mesh or a curve of a .blend whose world is the scene's.
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon

from r2sego_blender.commands.scripts import run_script
from r2sego_blender.core.errors import SceneError


def main(arguments: list[str]) -> int:
    """Declare, run if asked, and tell; returns 0."""
    parser = argparse.ArgumentParser(prog="robot_region.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--blend", type=Path, help="where the object is")
    parser.add_argument("--object", help="its name; no region is declared when left out")
    parser.add_argument("--run", type=int, metavar="ROUND", help="bring the scene to this round's rollouts")
    options = parser.parse_args(arguments)
    if options.object and options.blend is None:
        parser.error("name the .blend that --object is in with --blend")
    with enabled_addon():
        r2sego, scene = bpy.ops.r2sego, bpy.context.scene
        r2sego.open_scene(directory=str(options.scene.absolute()))
        if options.object:
            choose(options.blend, options.object)
            r2sego.region_from_object()
        if options.run is not None:
            r2sego.run_rollouts(round_index=options.run)
            scene.r2sego.round_index = options.run
        for fact in scene.r2sego.facts:
            if fact.section == "robot":
                print(f"{fact.label}: {fact.value}")
        print(f"region: {scene.r2sego_robot.region or 'free floor'}")
        attempts = scene.r2sego_robot.attempts
        print(f"{sum(one.success for one in attempts)} of {len(attempts)} attempts succeeded")
    return 0


def choose(blend: Path, name: str) -> None:
    """Take an object over from a .blend, and make it the active one. Raises SceneError: none."""
    with bpy.data.libraries.load(str(blend.absolute())) as (there, taken):
        if name not in there.objects:
            raise SceneError(f"there is no object '{name}'", where=blend, cure="Name one of its objects.")
        taken.objects = [name]
    (found,) = taken.objects
    bpy.context.scene.collection.objects.link(found)
    bpy.context.view_layer.objects.active = found


if __name__ == "__main__":
    run_script(main)
