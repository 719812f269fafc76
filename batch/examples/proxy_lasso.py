"""Cut the proxy's faces that a capture shows inside a polygon.

blender --background --python batch/examples/proxy_lasso.py -- SCENE --lasso "photo_01.png:10,10 90,10 90,60"
python batch/examples/proxy_lasso.py -- SCENE --lasso "a.png:1,1 9,1 9,9" --lasso "b.png:2,2 8,2 8,8" --name x

Without --name it only says how many faces are selected. Pixels count from the top left corner. A
capture is named with its suffix, as in the bundle.
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from capture_lasso import lasso, lasso_through
from enabled_addon import enabled_addon

from r2sego_blender.commands.scripts import run_script
from r2sego_blender.core.errors import CaptureError


def main(arguments: list[str]) -> int:
    """Select, cut if asked, and tell; returns 0."""
    parser = argparse.ArgumentParser(prog="proxy_lasso.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--round", type=int, default=None, help="from 0; the last one when left out")
    parser.add_argument("--lasso", type=lasso, action="append", required=True, metavar="CAPTURE:X,Y X,Y X,Y")
    parser.add_argument("--farthest", type=float, default=20.0, help="faces farther than this stay, metres")
    parser.add_argument("--behind", action="store_true", help="faces seen from behind too")
    parser.add_argument("--name", help="cut them, and call the edit so")
    options = parser.parse_args(arguments)
    with enabled_addon():
        r2sego, scene = bpy.ops.r2sego, bpy.context.scene
        r2sego.open_scene(directory=str(options.scene.absolute()))
        if options.round is not None:
            scene.r2sego.round_index = options.round
        r2sego.import_captures(points=False)
        r2sego.show_proxy()
        for capture, corners in options.lasso:
            if capture not in scene.r2sego_captures.captures:
                raise CaptureError(f"there is no capture '{capture}'", cure="Name one of the bundle.")
            drawn = lasso_through(capture, corners)
            r2sego.select_proxy_lasso(**drawn, farthest=options.farthest, facing=not options.behind, extend=True)
        proxy = bpy.data.objects[f"Proxy, round {scene.r2sego.round_index}"].data
        print(f"{sum(face.select for face in proxy.polygons)} of {len(proxy.polygons)} faces are selected")
        if options.name:
            r2sego.cut_proxy(name=options.name)
        for edit in scene.r2sego_proxy.edits:
            print(f"edit {edit.name}: {edit.kind}, {edit.faces} faces, {edit.area:.2f} m2")
    return 0


if __name__ == "__main__":
    run_script(main)
