"""Set up the engine, ask what it has, make the demo scene, and follow a job that another Blender left.

blender --background --python batch/examples/engine_setup.py -- --set-up --wheels FOLDER
blender --background --python batch/examples/engine_setup.py -- --models
blender --background --python batch/examples/engine_setup.py -- --demo FOLDER [--preset preview]
python batch/examples/engine_setup.py -- --follow SCENE  (pip bpy)

Without options it asks the engine what it is. Without a window an operator waits for its
job; one that is interrupted (Ctrl-C) ends it, and finished steps are kept.
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon

from r2sego_blender.commands.scripts import run_script


def main(arguments: list[str]) -> int:
    """Do what the options say, in this order; returns 0."""
    parser = argparse.ArgumentParser(prog="engine_setup.py", description=__doc__.splitlines()[0])
    parser.add_argument("--set-up", action="store_true", help="install the engine into the add-on's folder")
    parser.add_argument("--wheels", default="", help="from this folder of wheels, and not from the network")
    parser.add_argument("--models", action="store_true", help="say which learned models can be used here")
    parser.add_argument("--demo", default="", metavar="FOLDER", help="make demo_room.r2s there and refine it")
    parser.add_argument("--preset", default="preview", help="settings of the demo scene")
    parser.add_argument("--follow", default="", metavar="SCENE", help="the bundle whose job is followed")
    options = parser.parse_args(arguments)
    with enabled_addon():
        press(options)
    return 0


def press(options: argparse.Namespace) -> None:
    """Press the room's buttons."""
    if options.set_up:
        bpy.ops.r2sego.set_up_engine(wheels=options.wheels)
    bpy.ops.r2sego.check_engine()
    if options.models:
        bpy.ops.r2sego.check_backends()
        for one in bpy.context.window_manager.r2sego_engine.backends:
            print(f"{one.name}: {one.why or 'can be used'}")
    if options.demo:
        bpy.ops.r2sego.demo_scene(directory=options.demo, preset=options.preset)
        tell()
    if options.follow:
        bpy.ops.r2sego.open_scene(directory=options.follow)
        bpy.ops.r2sego.follow_job()
        tell()


def tell() -> None:
    """Print how jobs ended and what the scene holds now, and dismiss the lines."""
    ended = bpy.context.window_manager.r2sego_engine.ended
    while ended:
        print(f"{ended[0].title}: {ended[0].line}")
        bpy.ops.r2sego.dismiss_job(index=0)
    scene = bpy.context.scene.r2sego
    print(f"{scene.bundle}: {scene.rounds_done} of {scene.rounds_declared} rounds")


if __name__ == "__main__":
    run_script(main)
