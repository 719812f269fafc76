"""A refinement from inside Blender with the real engine, button by button.

python tests/operators/refine_in_blender.py -- ZIP ENGINE ROOM SCENE EXPORT OUT.json

Makes SCENE from the photographs of ROOM, refines it for a short round, shows what came out
and exports it; OUT.json then tells what Blender holds.
"""

import json
import sys
from pathlib import Path

import bpy

ZIP, ENGINE, ROOM, SCENE, EXPORT, OUT = (Path(argument) for argument in sys.argv[sys.argv.index("--") + 1 :])
SHORT = {
    "rounds": 1,
    "stereo__max_side_px": 160,
    "stereo__iterations": 3,
    "stereo__geometric_rounds": 1,
    "proxy__voxel_m": 0.06,
    "collision__tolerance_m": 0.1,
    "collision__carrying_tolerance_m": 0.1,
    "collision__min_cell_m": 0.2,
    "rollouts__successes": 2,
    "selection__target_views": 2,
    "generation__clip_frames": 3,
    "training__steps_per_round": 20,
    "training__max_gaussians": 20000,
}


def press(operator, **properties):
    assert operator(**properties) == {"FINISHED"}, operator


def main():
    bpy.ops.extensions.package_install_files(
        filepath=str(ZIP), repo="user_default", enable_on_install=True, overwrite=True
    )
    bpy.context.preferences.addons["bl_ext.user_default.r2sego"].preferences.engine_python = str(ENGINE)
    bpy.ops.wm.read_homefile(use_empty=True)
    r2sego = bpy.ops.r2sego
    press(r2sego.new_scene, filepath=str(SCENE), captures=str(ROOM / "captures"), poses=str(ROOM / "cameras.json"))
    state = bpy.context.scene.r2sego
    for name, value in SHORT.items():
        setattr(state.settings, name, value)
    press(r2sego.refine)
    press(r2sego.import_captures)
    press(r2sego.show_proxy)
    press(r2sego.show_candidates)
    press(r2sego.show_collision)
    press(r2sego.export_collision, directory=str(EXPORT))
    OUT.write_text(
        json.dumps(
            {
                "rounds_done": state.rounds_done,
                "cameras": sum(item.type == "CAMERA" for item in bpy.data.objects),
                "faces": max(len(mesh.polygons) for mesh in bpy.data.meshes),
            }
        )
    )


main()
