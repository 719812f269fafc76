"""Look at the tab in one state: which buttons it draws, which the mouse reaches, and a picture.

blender --enable-event-simulate --python look.py -- OUT ZIP BUNDLE ENGINE STATE SCALE
"""

import json
import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import hand  # found beside this file

_, ZIP, BUNDLE, ENGINE, STATE, SCALE = sys.argv[sys.argv.index("--") + 1 :]
COLUMNS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.78, 0.85, 0.88, 0.93)


def scene():
    """A bundle is open."""
    bpy.ops.r2sego.open_scene(directory=BUNDLE)


def shown():
    """What a bundle holds is shown."""
    scene()
    for name in ("import_captures", "show_proxy", "show_candidates", "show_asset", "show_rollout"):
        if hasattr(bpy.types, f"R2SEGO_OT_{name}"):
            getattr(bpy.ops.r2sego, name)()


def working():
    """The engine works on a command that takes long."""
    scene()
    (Path(ENGINE).parent / "conduct.txt").write_text("sleep")
    area, _ = hand.view()
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=hand.window(), area=area, region=region):
        bpy.ops.r2sego.refine("INVOKE_DEFAULT")


STATES = {"no_engine": lambda: None, "no_scene": lambda: None, "scene": scene, "shown": shown,
          "working": working, "cut": lambda: None}  # fmt: skip


class TEST_PT_cut(bpy.types.Panel):  # noqa: N801
    """Texts that do not fit, each with another letter where it ends"""

    bl_idname, bl_label, bl_category = "TEST_PT_cut", "Cut", hand.TAB
    bl_space_type, bl_region_type = "VIEW_3D", "UI"

    def draw(self, context):
        for letters in ("aeo", "mnw", "ilt", "bdh", "xyz", "ABC", "123", "rsu"):
            self.layout.label(text=f"{letters} " * 40)
            self.layout.operator("screen.screenshot", text=f"{letters} " * 40)


def install():
    """Install the add-on and leave every panel open."""
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.ui_scale = float(SCALE)
    bpy.ops.extensions.package_install_files(
        filepath=ZIP, repo="user_default", enable_on_install=True, overwrite=True
    )
    if STATE != "no_engine":
        bpy.context.preferences.addons["bl_ext.user_default.r2sego"].preferences.engine_python = ENGINE
    hand.open_all_panels()
    if STATE == "cut":
        bpy.utils.register_class(TEST_PT_cut)


def script():
    """Open the state, take its picture, move over everything."""
    install()
    scale = float(SCALE)
    drawn = hand.Drawn()
    STATES[STATE]()
    yield from hand.open_tab()
    yield 1.0
    _, bar = hand.view()
    yield from hand.move(bar.x - 40, bar.y + 20)
    yield from hand.picture("picture")
    met = {}
    if STATE not in ("working", "cut"):
        met = yield from hand.sweep(int(14 * scale), COLUMNS)
    frame = {"x": bar.x, "y": bar.y, "width": bar.width, "height": bar.height,
             "window_height": hand.window().height}  # fmt: skip
    told = {"drawn": drawn.operators(), "met": met, "bar": frame, "layouts": drawn.layouts}
    if STATE == "working":
        started_s = time.monotonic()
        bpy.ops.r2sego.cancel()
        job = bpy.context.window_manager.r2sego_job
        while job.running and time.monotonic() - started_s < 10.0:
            yield 0.1
        told["cancelled_after_s"] = time.monotonic() - started_s
        told["still_running"] = job.running
    (hand.OUT / "told.json").write_text(json.dumps(told, default=str))


hand.perform(script())
