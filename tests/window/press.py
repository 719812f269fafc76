"""Press every button of the tab that is not grey, as a person does, and tell what came of it.

blender --enable-event-simulate --python press.py -- OUT ZIP BUNDLE ENGINE
"""

import json
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import drawn_buttons  # found beside this file
import hand
import search

_, ZIP, BUNDLE, ENGINE = sys.argv[sys.argv.index("--") + 1 :]
SHOW = ("import_captures", "show_proxy", "show_candidates", "show_asset", "show_rollout")
"""What shows all that a bundle holds."""

LEFT_OUT = {"r2sego.open_report": "opens the web browser"}
_PASSES = 6  # what is pressed makes others ready: show, then mark, then delete
_SHIFT_STEP_PX = 10
_JOB_S = 20.0


def install(every_panel=True):
    """Install the add-on, open the bundle and, unless they are to be as they come, every panel."""
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.edit.undo_steps = 256  # all that is pressed
    bpy.ops.extensions.package_install_files(filepath=ZIP, repo="user_default", enable_on_install=True, overwrite=True)
    bpy.context.preferences.addons["bl_ext.user_default.r2sego"].preferences.engine_python = ENGINE
    if every_panel:
        drawn_buttons.open_panels()
    for name in ("Kept before", "Kept too"):  # so that Load has an entry after Remove was pressed
        bpy.ops.r2sego.keep_settings(name=name)
    bpy.ops.r2sego.open_scene(directory=BUNDLE)


def listen():
    """Have the add-on's operators noted as they are called: [[identifier, method, answer], ...]."""
    notes = []
    for cls in bpy.types.Operator.__subclasses__():
        if getattr(cls, "bl_idname", "").startswith("r2sego."):
            for name in ("invoke", "execute"):
                if any(name in vars(base) for base in cls.__mro__):
                    setattr(cls, name, noting(getattr(cls, name), cls.bl_idname, name, notes))
    return notes


def noting(method, identifier, name, notes):
    """The operator's method, which notes its calls."""

    def noted(*arguments):
        note = [identifier, name, "raised"]
        notes.append(note)
        answer = method(*arguments)
        note[2] = " ".join(sorted(answer))
        return answer

    def invoke(operator, context, event):  # Blender gives as many arguments as are written here
        return noted(operator, context, event)

    def execute(operator, context):
        return noted(operator, context)

    return {"invoke": invoke, "execute": execute}[name]


def ready(call):
    """Whether the operator may run where the side bar's buttons call it."""
    area, bar = hand.view()
    with bpy.context.temp_override(window=hand.window(), area=area, region=bar):
        return getattr(bpy.ops.r2sego, drawn_buttons.name_of(call).removeprefix("r2sego.")).poll()


def moved(call, place, shift):
    """How far the button has moved up from ``place``, about ``shift``; None when it is not found."""
    yield from hand.move(place[0], place[1] + shift)
    if search.under_mouse() == call:
        return shift
    _, bar = hand.view()
    below, above = bar.y - place[1], bar.y + bar.height - place[1]
    ways = sorted(range(below, above, _SHIFT_STEP_PX), key=lambda way: abs(way - shift))
    for some in (ways[:60], ways[60:]):
        met = yield from search.hover([(place[0], place[1] + way) for way in some])
        for way in some:
            if met.get((place[0], place[1] + way)) == call:
                return way
    return None


def press(call, place, notes):
    """Click there, leave again whatever it opened; returns the notes of what was called."""
    (hand.OUT / "pressing.txt").write_text(call)
    del notes[:]
    yield from hand.click(*place)
    for _ in range(20):
        if notes:
            break
        yield 0.1
    said = [list(note) for note in notes]
    yield 0.2
    close_what_opened()
    if any(answer != "FINISHED" for _, _, answer in said) or not said:  # a dialog, or an error's popup
        for _ in range(2):
            yield from hand.key("ESC")
    job = bpy.context.window_manager.r2sego_job
    if job.running:
        for _ in range(int(_JOB_S / 0.1)):
            if not job.running:
                break
            yield 0.1
        yield 0.7  # its result is taken over and shown
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    if bpy.context.scene.r2sego.bundle != BUNDLE:
        bpy.ops.r2sego.open_scene(directory=BUNDLE)
    yield 0.1
    return said


def close_what_opened():
    """Close other windows and file browsers."""
    for extra in list(bpy.context.window_manager.windows)[1:]:
        with bpy.context.temp_override(window=extra):
            bpy.ops.wm.window_close()
    for area in list(hand.window().screen.areas):
        if area.type == "FILE_BROWSER":
            with bpy.context.temp_override(window=hand.window(), area=area):
                bpy.ops.file.cancel()


def press_menu(call, near, notes):
    """Open the menu and press its first entry; returns the notes of what was called."""
    entry = yield from search.open_menu(call, near, 1)
    return (yield from press(call, entry, notes)) if entry else []


def go_through_history(step):
    """Take every step back, or do each again; returns how many there were. Data that is in no step of
    Blender's history crashes it here."""
    area, _ = hand.view()
    region = next(region for region in area.regions if region.type == "WINDOW")
    for count in range(bpy.context.preferences.edit.undo_steps + 1):
        with bpy.context.temp_override(window=hand.window(), area=area, region=region):
            if not step.poll() or step() != {"FINISHED"}:
                return count
        yield 0.2
    return count


def script():
    """Press what is ready, from below, until nothing new can be pressed; then undo all, and redo it."""
    install()
    drawn, notes = drawn_buttons.Drawn(), listen()
    yield from hand.open_tab()
    told, first, names = {}, None, set()
    for _ in range(_PASSES):
        yield from drawn.anew()
        buttons = drawn.buttons()
        first = set(buttons) if first is None else first
        due = [
            call
            for call in buttons
            if not told.get(call)
            and (call in first or drawn_buttons.name_of(call) not in names)
            and drawn_buttons.name_of(call) not in LEFT_OUT
            and ready(call)
        ]
        if not due:
            break
        met, silent = yield from search.find({call for call in due if not buttons[call]}, 1)
        shift = 0
        for call in reversed(due):
            if not ready(call):
                continue
            if buttons[call]:
                near = search.beside(call, list(buttons), met, silent)
                said = yield from press_menu(call, [(x, y + shift) for x, y in near], notes)
            elif call not in met:
                told[call] = "the mouse does not reach it"
                continue
            else:
                by = yield from moved(call, met[call], shift)
                if by is None:  # drawn no longer, or with other arguments: the next pass sees
                    continue
                shift = by
                said = yield from press(call, (met[call][0], met[call][1] + shift), notes)
            told[call] = said
            names.add(drawn_buttons.name_of(call))
    yield from drawn.anew()
    grey = sorted(call for call in drawn.buttons() if call not in told and not ready(call))
    seen = {"pressed": told, "grey": grey, "first": sorted(first), "last": sorted(drawn.buttons())}
    (hand.OUT / "pressing.txt").write_text("undo and redo")
    seen["undone"] = yield from go_through_history(bpy.ops.ed.undo)
    seen["redone"] = yield from go_through_history(bpy.ops.ed.redo)
    (hand.OUT / "told.json").write_text(json.dumps(seen))


if __name__ == "__main__":
    hand.perform(script(), plain=True)
