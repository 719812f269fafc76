"""Render the structural conditions of target views' clips, inside Blender.

blender --background --python batch/examples/render_conditions.py -- SCENE --to FOLDER [--view 0]
python batch/examples/render_conditions.py -- SCENE --to FOLDER --engine eevee  (pip bpy)

Each view gets a folder of multilayer EXRs, 000.exr at the reference capture and the last one
at the target, and a manifest.json with the cameras and passes. On a render farm start it with --share on as many
machines as there are: each renders the frames that no other has, and one started again goes on. Or each machine
takes a --view, or --frames of a clip. Begin with an empty folder.
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from r2sego_blender.bridge.generation.conditions import ConditionScene, render_path, render_shared
from r2sego_blender.commands.scripts import run_script
from r2sego_blender.core.errors import SceneError
from r2sego_blender.results.panels.bundle import Bundle


def main(arguments: list[str]) -> int:
    """Render the clips; returns 0."""
    parser = argparse.ArgumentParser(prog="render_conditions.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--to", type=Path, required=True, help="folder for the views' folders")
    parser.add_argument("--round", type=int, default=None, help="from 0; the last one when left out")
    parser.add_argument("--view", type=int, default=None, help="from 0; every clip when left out")
    part = parser.add_mutually_exclusive_group()
    part.add_argument("--share", action="store_true", help="the frames that no other has rendered or renders now")
    part.add_argument(
        "--frames",
        type=int,
        nargs=2,
        metavar=("FIRST", "LAST"),
        help="these alone of each clip, the last included, into a folder that several machines share",
    )
    parser.add_argument("--engine", choices=("cycles", "eevee"), default="cycles")
    parser.add_argument("--scale", type=float, default=1.0, help="image scale, from 0.05 to 1")
    options = parser.parse_args(arguments)
    if not 0.05 <= options.scale <= 1.0:
        parser.error(f"--scale {options.scale:g} is not from 0.05 to 1")
    bundle = Bundle.open(options.scene)
    if not bundle.rounds():
        raise SceneError("there is no geometry proxy yet", where=options.scene, cure="Run Refine first.")
    shown = bundle.rounds() - 1 if options.round is None else options.round
    views = views_with_clips(bundle, shown) if options.view is None else [options.view]
    bpy.ops.wm.read_homefile(use_empty=True)
    # One scene for all clips: the proxy goes to the render engine once.
    scene = ConditionScene(bundle.proxy(shown), options.engine)
    for view in views:
        path = [camera.scaled(options.scale) for camera in bundle.camera_path(shown, view)]
        folder = options.to / f"{view:03d}"
        if options.share:
            files = render_shared(scene, path, folder, options.engine)
        else:
            only = None if options.frames is None else range(options.frames[0], options.frames[1] + 1)
            files = render_path(scene, path, folder, options.engine, only=only)
        print(f"view {view}: {len(files)} frames in {folder}")
    return 0


def views_with_clips(bundle: Bundle, round_index: int) -> list[int]:
    """The round's views that have a camera path. Raises SceneError when none has."""
    folder = bundle.scene.round_folder(round_index) / "views"
    views = sorted(int(file.parent.name) for file in folder.glob("[0-9][0-9][0-9]/path.json"))
    if not views:
        raise SceneError("this round has no clips", where=folder, cure="Run Refine, or choose another round.")
    return views


if __name__ == "__main__":
    run_script(main)
