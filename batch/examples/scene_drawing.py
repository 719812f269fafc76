"""Show a round's proxy and robot's views, light to draw without a graphics card, and save a .blend.

blender --background --python batch/examples/scene_drawing.py -- SCENE room.blend [--faces 10000]
python batch/examples/scene_drawing.py -- SCENE room.blend  (pip bpy)
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon

from r2sego_blender.bridge.proxy.show_proxy import shown_proxies
from r2sego_blender.bridge.shared.simplified_viewport import FACES_DRAWN, draw_fewer_faces
from r2sego_blender.commands.scripts import run_script


def main(arguments: list[str]) -> int:
    """Show, simplify, save; returns 0."""
    parser = argparse.ArgumentParser(prog="scene_drawing.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("blend", type=Path)
    parser.add_argument("--faces", type=int, default=FACES_DRAWN, help="of the proxy, drawn at most")
    options = parser.parse_args(arguments)
    with enabled_addon():
        bpy.ops.r2sego.open_scene(directory=str(options.scene.absolute()))
        bpy.ops.r2sego.show_proxy()
        bpy.ops.r2sego.show_candidates()
        bpy.ops.r2sego.simplify_viewport()
        for shown in shown_proxies():
            draw_fewer_faces(shown, options.faces)
            drawn = shown.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
            print(f"{shown.name}: {len(drawn.polygons)} of {len(shown.data.polygons)} faces are drawn")
        bpy.ops.wm.save_as_mainfile(filepath=str(options.blend.absolute()))
    return 0


if __name__ == "__main__":
    run_script(main)
