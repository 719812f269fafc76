"""Show the collision surface, check it in MuJoCo, texture the proxy, and export for simulators.

blender --background --python batch/examples/collision_check.py -- SCENE [--to FOLDER]
python batch/examples/collision_check.py -- SCENE --to FOLDER [--splats .spz,.glb] [--textured]  (pip bpy)
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon

from r2sego_blender.commands.scripts import run_script


def main(arguments: list[str]) -> int:
    """Press the room's buttons one after the other; returns 0."""
    parser = argparse.ArgumentParser(prog="collision_check.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--to", type=Path, help="the folder to export to")
    parser.add_argument("--splats", default="", metavar=".SPZ,.GLB", help="the asset in these formats too")
    parser.add_argument("--textured", action="store_true", help="export the proxy with baked colours too")
    parser.add_argument("--texture", action="store_true", help="bake the captures' colours onto the proxy")
    parser.add_argument("--faces", type=int, default=30000, help="of the textured mesh")
    parser.add_argument("--size", type=int, default=2048, help="texels a side")
    options = parser.parse_args(arguments)
    chosen = {f".{suffix.strip().lstrip('.').lower()}" for suffix in options.splats.split(",") if suffix}
    with enabled_addon():
        r2sego, group = bpy.ops.r2sego, bpy.context.scene.r2sego_collision
        r2sego.open_scene(directory=str(options.scene.absolute()))
        r2sego.show_collision()
        print(f"{len(bpy.data.objects['Collision'].data.polygons)} faces of convex pieces")
        r2sego.check_collision()
        print("passed" if group.passed else "not passed")
        if options.texture:
            r2sego.texture_proxy(faces=options.faces, size=options.size)
        if options.to:
            folder = str(options.to.absolute())
            r2sego.export_collision(directory=folder, splats=chosen, textured=options.textured)
            print(f"exported to {options.to}")
        for fact in (*group.check, *group.texture):
            print(f"{fact.name}: {fact.value}")
    return 0


if __name__ == "__main__":
    run_script(main)
