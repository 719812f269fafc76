"""Look at the tab in one state: which buttons it draws, which the mouse reaches, and a picture.

blender --enable-event-simulate --python look.py -- OUT ZIP BUNDLE ENGINE STATE SCALE
"""

import json
import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import drawn_buttons  # found beside this file
import hand
import search

_, ZIP, BUNDLE, ENGINE, STATE, SCALE = sys.argv[sys.argv.index("--") + 1 :]
FOUND_WITHIN_S = 20.0
CANCEL = "bpy.ops.r2sego.cancel()"
SEARCHED = ("no_engine", "no_scene", "scene", "shown")


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


STATES = {
    "no_engine": lambda: None,
    "no_scene": lambda: None,
    "scene": scene,
    "shown": shown,
    "working": working,
    "cancelled": working,
    "left": working,
    "found": scene,
    "settings": lambda: None,
    "cut": lambda: None,
}


class TEST_PT_cut(bpy.types.Panel):  # noqa: N801
    """Texts that do not fit, each with another letter where it ends"""

    bl_idname, bl_label, bl_category = "TEST_PT_cut", "Cut", hand.TAB
    bl_space_type, bl_region_type = "VIEW_3D", "UI"

    def draw(self, context):
        for letters in ("aeo", "mnw", "ilt", "bdh", "xyz", "ABC", "123", "rsu"):
            self.layout.label(text=f"{letters} " * 40)
            self.layout.operator("screen.screenshot", text=f"{letters} " * 40)


def install():
    """Install the add-on and leave every panel open; of the settings' state theirs alone, it is long."""
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.ui_scale = float(SCALE)
    bpy.ops.extensions.package_install_files(filepath=ZIP, repo="user_default", enable_on_install=True, overwrite=True)
    if STATE != "no_engine":
        bpy.context.preferences.addons["bl_ext.user_default.r2sego"].preferences.engine_python = ENGINE
    bpy.ops.r2sego.keep_settings(name="Kept before")  # so that the menus of kept settings have an entry
    settings = f"{drawn_buttons.PANELS}_settings"
    drawn_buttons.open_panels(settings if STATE == "settings" else drawn_buttons.PANELS)
    if STATE == "cut":
        bpy.utils.register_class(TEST_PT_cut)


def reached(buttons, scale):
    """Those of ``buttons`` ({call: whether it opens a menu}) that the mouse reaches, sorted."""
    met, silent = yield from search.find({call for call, menu in buttons.items() if not menu}, scale)
    for call in (call for call, menu in buttons.items() if menu):
        near = search.beside(call, list(buttons), met, silent)
        if (yield from search.open_menu(call, near, scale)):
            met[call] = near
            yield from hand.key("ESC")
    return sorted(met.keys() & buttons.keys())


def cancelled(bar, scale):
    """Cancel by the button, or by ESC over the 3D view what another Blender left: how long it took."""
    job = bpy.context.window_manager.r2sego_job
    began_s = time.monotonic()
    while not job.running and time.monotonic() - began_s < FOUND_WITHIN_S:
        yield 0.1
    told = {"running": job.running}
    if STATE != "found":
        met, _ = yield from search.find({CANCEL}, scale)
        started_s = time.monotonic()
        yield from hand.click(*met[CANCEL])
    else:
        yield from hand.move(bar.x - 40, bar.y + bar.height // 2)
        started_s = time.monotonic()
        yield from hand.key("ESC")
    while job.running and time.monotonic() - started_s < 10.0:
        yield 0.1
    return told | {"cancelled_after_s": time.monotonic() - started_s, "still_running": job.running}


def script():
    """Open the state, take its picture, move over everything."""
    install()
    scale = float(SCALE)
    drawn = drawn_buttons.Drawn(open_sections=STATE == "settings")
    yield from hand.open_tab()
    STATES[STATE]()
    yield from drawn.anew()
    yield 1.0
    _, bar = hand.view()
    yield from hand.move(bar.x - 40, bar.y + 20)
    yield from hand.picture("picture")
    frame = {"x": bar.x, "y": bar.y, "width": bar.width, "height": bar.height, "window_height": hand.window().height}
    met = []
    if STATE in SEARCHED:
        met = yield from reached(drawn.buttons(), scale)
    told = {"drawn": sorted(drawn.buttons()), "met": met, "bar": frame}
    if STATE in ("working", "cancelled", "found"):
        told |= yield from cancelled(bar, scale)
    (hand.OUT / "told.json").write_text(json.dumps(told))


hand.perform(script(), plain=True)
