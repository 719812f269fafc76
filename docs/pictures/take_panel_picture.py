"""Arrange Blender's window for docs/pictures/panel.jpg, then wait for the picture to be taken.

The tab itself is opened with a click: Blender lets no script choose it.

blender --window-geometry 0 0 1400 900 --python docs/pictures/take_panel_picture.py -- ZIP BUNDLE SECONDS
"""

import sys
from pathlib import Path

import bpy
from mathutils import Euler

PACKAGE, BUNDLE, SECONDS = sys.argv[sys.argv.index("--") + 1 :]
VIEW_ANGLES_RAD = (0.85, 0.0, 0.6)
VIEW_CENTRE_M = (1.7, 0.3, 0.4)
VIEW_DISTANCE_M = 11.0


def arrange():
    """Show the bundle's captures, proxy and targets beside the open tab."""
    window = bpy.context.window_manager.windows[0]
    area = max((a for a in window.screen.areas if a.type == "VIEW_3D"), key=lambda a: a.width)
    region = next(r for r in area.regions if r.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        for name in ("Cube", "Light", "Camera"):
            if name in bpy.data.objects:
                bpy.data.objects.remove(bpy.data.objects[name])
        bpy.ops.r2sego.open_scene(directory=str(Path(BUNDLE).absolute()))
        bpy.ops.r2sego.import_captures()
        bpy.ops.r2sego.show_proxy()
        bpy.ops.r2sego.show_candidates()
        space = area.spaces.active
        space.show_region_ui = True
        space.overlay.show_floor = False
        space.region_3d.view_location = VIEW_CENTRE_M
        space.region_3d.view_distance = VIEW_DISTANCE_M
        space.region_3d.view_rotation = Euler(VIEW_ANGLES_RAD).to_quaternion()
        bpy.ops.screen.screen_full_area()


def leave():
    """Close Blender."""
    bpy.ops.wm.quit_blender()


def main():
    bpy.context.preferences.view.show_splash = False
    bpy.ops.extensions.package_install_files(
        filepath=str(Path(PACKAGE).absolute()), repo="user_default", enable_on_install=True, overwrite=True
    )
    bpy.app.timers.register(arrange, first_interval=2.0)
    bpy.app.timers.register(leave, first_interval=float(SECONDS))


main()
