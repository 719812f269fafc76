"""Press every button of the tab that is not grey, as a person does, and tell what came of it.

blender --enable-event-simulate --python press.py -- OUT ZIP BUNDLE ENGINE
"""

import json
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import hand  # found beside this file

_, ZIP, BUNDLE, ENGINE = sys.argv[sys.argv.index("--") + 1 :]
LEFT_OUT = {"r2sego.open_report": "opens the web browser"}
COLUMNS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.78, 0.85, 0.88, 0.93)


def install():
    """Install the add-on, open every panel and the bundle."""
    bpy.context.preferences.view.show_splash = False
    bpy.ops.extensions.package_install_files(
        filepath=ZIP, repo="user_default", enable_on_install=True, overwrite=True
    )
    bpy.context.preferences.addons["bl_ext.user_default.r2sego"].preferences.engine_python = ENGINE
    hand.open_all_panels()
    bpy.ops.r2sego.open_scene(directory=BUNDLE)


def ran():
    """How many operators Blender remembers, and the last."""
    operators = bpy.context.window_manager.operators
    return (len(operators), operators[-1].bl_idname if operators else "")


def poll(name):
    """Whether the operator may run where the side bar's buttons call it."""
    area, bar = hand.view()
    with bpy.context.temp_override(window=hand.window(), area=area, region=bar):
        return getattr(bpy.ops.r2sego, name.removeprefix("r2sego.")).poll()


def pressed(name, place):
    """Click there; tells what opened, then leaves it again."""
    before, windows = ran(), len(bpy.context.window_manager.windows)
    areas = {area.type for area in hand.window().screen.areas}
    yield from hand.click(*place)
    yield 0.6
    came = {"ran": ran() != before, "windows": len(bpy.context.window_manager.windows) - windows}
    came["areas"] = sorted({area.type for area in hand.window().screen.areas} - areas)
    came["busy"] = bool(bpy.context.window_manager.r2sego_job.running)
    for extra in list(bpy.context.window_manager.windows)[1:]:
        with bpy.context.temp_override(window=extra):
            bpy.ops.wm.window_close()
    for _ in range(3):
        yield from hand.key("ESC")
    for area in list(hand.window().screen.areas):
        if area.type == "FILE_BROWSER":
            with bpy.context.temp_override(window=hand.window(), area=area):
                bpy.ops.file.cancel()
    job = bpy.context.window_manager.r2sego_job
    for _ in range(50):
        if not job.running:
            break
        yield 0.1
    return came


def script():
    """Find the buttons, press one after the other, each in the open bundle."""
    install()
    drawn = hand.Drawn()
    yield from hand.open_tab()
    yield 1.0
    met = yield from hand.sweep(14, COLUMNS)
    told = {}
    for name in sorted(met):
        if name in LEFT_OUT or not poll(name):
            continue
        # What was pressed before may have moved the buttons: look for this one again.
        place = met[name]
        yield from hand.move(*place)
        if hand.operator_under_mouse() != name:
            found = yield from hand.sweep(14, COLUMNS)
            if name not in found:
                told[name] = {"gone": True}
                continue
            place = found[name]
        (hand.OUT / "pressing.txt").write_text(name)
        told[name] = yield from pressed(name, place)
        if bpy.context.scene.r2sego.bundle != BUNDLE:
            bpy.ops.r2sego.open_scene(directory=BUNDLE)
        yield 0.2
    (hand.OUT / "told.json").write_text(json.dumps({"pressed": told, "drawn": drawn.operators()}))


if __name__ == "__main__":
    hand.perform(script())
