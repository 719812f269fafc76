"""Make a .blend of a scene bundle: captures, geometry proxy, candidate and target views.

blender --background --python batch/import_scene.py -- SCENE OUT.blend [--round 2]
python batch/import_scene.py -- SCENE OUT.blend [--round 2]  (an environment with pip bpy)
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from r2sego_blender.bridge.captures.show_captures import show_captures
from r2sego_blender.bridge.proxy.show_proxy import show_proxy
from r2sego_blender.bridge.views.show_candidates import show_candidates
from r2sego_blender.commands.scripts import run_script
from r2sego_blender.results.panels.bundle import Bundle


def main(arguments: list[str]) -> int:
    """Write the .blend; returns 0."""
    parser = argparse.ArgumentParser(prog="import_scene.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("blend", type=Path)
    parser.add_argument("--round", type=int, default=None, help="from 0; the last one when left out")
    options = parser.parse_args(arguments)
    bundle = Bundle.open(options.scene)
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    print(f"{len(show_captures(scene, bundle))} captures")
    if bundle.rounds():
        shown = bundle.rounds() - 1 if options.round is None else options.round
        print(f"{len(show_proxy(scene, bundle, shown).data.polygons)} faces of the proxy of round {shown}")
        if bundle.selection_folder(shown).is_dir():
            print(f"{len(show_candidates(scene, bundle, shown)[1])} target views")
    bpy.ops.wm.save_as_mainfile(filepath=str(options.blend.absolute()))
    return 0


if __name__ == "__main__":
    run_script(main)
