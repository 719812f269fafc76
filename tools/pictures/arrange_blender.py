"""Arrange Blender's window for one of the documentation's pictures and have it taken.

blender --enable-event-simulate --python arrange_blender.py -- OUT ZIP BUNDLE ENGINE NAME
"""

import sys
from pathlib import Path

import bpy
from mathutils import Euler

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "window"))
import drawn_buttons  # found in the window tests
import hand

_, ZIP, BUNDLE, ENGINE, NAME = sys.argv[sys.argv.index("--") + 1 :]
VIEW_ANGLES_RAD = (0.85, 0.0, -0.45)
VIEW_CENTRE_M = (2.3, 0.3, 0.6)
VIEW_DISTANCE_M = 8.2
WIPE_ROUND, WIPE = 0, 0.5
ROLLOUT_SHARE = 0.4
CAMERA_ZOOM = 6.0
SETTLED_S = 1.0


def proxy():
    """The proxy by provenance with captures and candidates, the scores over time below."""
    bpy.ops.r2sego.import_captures()
    bpy.ops.r2sego.show_proxy()
    bpy.ops.r2sego.show_candidates()
    bpy.context.scene.r2sego_views.active = int(bpy.data.objects["Target 00"]["candidate"])
    bpy.context.scene.r2sego_views.curves = True
    yield 0.0


def support_gap():
    """The proxy by what the robot sees and captures support."""
    bpy.ops.r2sego.import_captures()
    bpy.ops.r2sego.show_proxy()
    bpy.context.scene.r2sego_proxy.colour_by = "SUPPORT_GAP"
    yield 0.0


def splats():
    """The refined asset's splats, and among them the robot on its way."""
    bpy.ops.r2sego.show_asset()
    bpy.ops.r2sego.show_rollout()
    while bpy.context.window_manager.r2sego_job.running:  # it is drawn when its bodies are there
        yield 0.5
    scene = bpy.context.scene
    scene.frame_set(round(scene.frame_start + ROLLOUT_SHARE * (scene.frame_end - scene.frame_start)))
    yield SETTLED_S  # then they are painted


def wipe():
    """A robot's view: the initial asset on the left of the divider, the refined one on the right."""
    bpy.context.scene.r2sego.round_index = WIPE_ROUND
    bpy.ops.r2sego.show_candidates(shown="TARGETS")
    targets = [camera for camera in bpy.data.objects if camera.type == "CAMERA" and "u" in camera]
    target = min(targets, key=lambda camera: camera["u"])  # of which the initial asset knows most
    bpy.context.view_layer.objects.active = target
    bpy.ops.r2sego.look_through()
    bpy.context.space_data.region_3d.view_camera_zoom = CAMERA_ZOOM
    for stage, place in (("initial", "LEFT"), ("final", "RIGHT")):
        bpy.ops.r2sego.render_asset(camera=target.name, stage=stage, place=place)
        yield 0.5
        while bpy.context.window_manager.r2sego_job.running:
            yield 0.5
    bpy.context.scene.r2sego_asset.wipe = WIPE
    for item in bpy.data.objects:  # the frusta stand in the way
        item.hide_set(item.type == "MESH")
    while bpy.context.window_manager.r2sego_engine.ended:
        bpy.ops.r2sego.dismiss_job()


def policy():
    """Where the episodes of a policy began, by how they ended, and one of them on the timeline."""
    bpy.ops.r2sego.show_proxy()
    bpy.ops.r2sego.show_policy_starts()
    bpy.ops.r2sego.show_policy_episode(episode=0)
    scene = bpy.context.scene
    scene.frame_set(round(scene.frame_start + ROLLOUT_SHARE * (scene.frame_end - scene.frame_start)))
    yield SETTLED_S


PICTURES = {
    "proxy": (proxy, {"proxy", "views", "views_candidate"}),
    "support_gap": (support_gap, {"proxy", "robot"}),
    "splats": (splats, {"scene", "asset", "asset_preview"}),
    "wipe": (wipe, {"asset", "asset_render"}),
    "policy": (policy, {"robot", "policy"}),
}
"""What each picture shows, and which sub-panels are open in it."""


def install(opened):
    """Install the add-on; all sub-panels but the ``opened`` ones are closed."""
    bpy.context.preferences.view.show_splash = False
    bpy.ops.extensions.package_install_files(filepath=ZIP, repo="user_default", enable_on_install=True, overwrite=True)
    bpy.context.preferences.addons["bl_ext.user_default.r2sego"].preferences.engine_python = ENGINE
    panels = {cls.bl_idname: cls for cls in drawn_buttons.panels()}

    def depth(cls):
        return 1 + depth(panels[cls.bl_parent_id]) if getattr(cls, "bl_parent_id", "") in panels else 0

    steps = sorted((cls for name, cls in panels.items() if name != "R2SEGO_PT_main"), key=depth)
    for cls in reversed(steps):
        bpy.utils.unregister_class(cls)
    for cls in steps:
        closed = cls.bl_idname.removeprefix("R2SEGO_PT_") not in opened
        cls.bl_options = {"DEFAULT_CLOSED"} if closed else set()
        bpy.utils.register_class(cls)


def enlarge_view():
    """The 3D view alone on the screen, as Ctrl Space does it over it."""
    area, _ = hand.view()
    x, y = area.x + area.width // 3, area.y + area.height // 2
    for _ in range(10):
        yield from hand.move(x, y)
        yield SETTLED_S
        for value in ("PRESS", "RELEASE"):
            hand.window().event_simulate("SPACE", value, x=x, y=y, ctrl=True)
        yield SETTLED_S
        if len(hand.window().screen.areas) == 1:
            return
    raise AssertionError("the view does not become larger")


def clear_view(space):
    """No startup objects, no grid, no sparse points over the surfaces; the room from above."""
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    space.overlay.show_cursor = space.overlay.show_text = False
    space.region_3d.view_rotation = Euler(VIEW_ANGLES_RAD).to_quaternion()
    space.region_3d.view_location = VIEW_CENTRE_M
    space.region_3d.view_distance = VIEW_DISTANCE_M


def script():
    """Open the tab, arrange the picture, have it taken."""
    arrange, opened = PICTURES[NAME]
    install(opened)
    yield 0.5
    yield from hand.open_tab()
    yield from enlarge_view()
    area, _ = hand.view()
    clear_view(area.spaces.active)
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=hand.window(), area=area, region=region):
        bpy.ops.r2sego.open_scene(directory=BUNDLE, show=False)
    bpy.context.scene.r2sego_captures.show_cloud = False
    arranging = arrange()
    while True:
        with bpy.context.temp_override(window=hand.window(), area=area, region=region):
            wait_s = next(arranging, None)
        if wait_s is None:
            break
        yield wait_s
    area, bar = hand.view()
    yield from hand.move(bar.x - 200, bar.y + 3)
    yield SETTLED_S
    yield from hand.picture(NAME)


hand.perform(script())
