"""A hand on Blender's mouse, used inside Blender by the window tests: it moves, clicks and looks.

Blender is started with ``--enable-event-simulate``. A script is a generator that yields the
seconds it waits, so that Blender draws and answers in between.
"""

import sys
import traceback
from pathlib import Path

import bpy

OUT = Path(sys.argv[sys.argv.index("--") + 1])
TAB = "R2S-EGO"
_SETTLE_S = 0.15
_TAB_STEP_PX = 20
_TAB_PX = 170  # below the bar's upper end, at interface scale 1, behind Blender's own tabs
_PICTURE_WAIT_S = 0.1
_mouse = [0, 0]
"""Where it was moved to last: Blender takes an event without a place for one at the window's corner."""


def perform(script, plain=False):
    """Run the generator ``script`` from a timer; quit Blender at its end, with its error in the log.

    ``plain`` draws the 3D view without smooth edges.
    """

    def tick():
        try:
            return next(script)
        except StopIteration:
            pass
        except BaseException:
            traceback.print_exc()
        bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(tick, first_interval=2.0, persistent=True)
    if plain:  # software GL draws a tall view many times over for smooth edges
        bpy.context.preferences.system.viewport_aa = "OFF"


def window():
    """Blender's first window."""
    return bpy.context.window_manager.windows[0]


def view():
    """The largest 3D view and its side bar."""
    areas = [area for area in window().screen.areas if area.type == "VIEW_3D"]
    area = max(areas, key=lambda a: a.width * a.height)
    return area, next(region for region in area.regions if region.type == "UI")


def move(x, y):
    """Move the mouse to a pixel of the window."""
    _mouse[:] = int(x), int(y)
    window().event_simulate("MOUSEMOVE", "NOTHING", x=int(x), y=int(y))
    yield 0.01


def click(x, y):
    """Click the left button there."""
    yield from move(x, y)
    for value in ("PRESS", "RELEASE"):
        window().event_simulate("LEFTMOUSE", value, x=int(x), y=int(y))
    yield _SETTLE_S


def drag(corners):
    """Draw a line with the left button through pixels of the window."""
    yield from move(*corners[0])
    window().event_simulate("LEFTMOUSE", "PRESS", x=_mouse[0], y=_mouse[1])
    for corner in corners[1:]:
        yield from move(*corner)
    window().event_simulate("LEFTMOUSE", "RELEASE", x=_mouse[0], y=_mouse[1])
    yield _SETTLE_S


def key(kind):
    """Press and release a key where the mouse is."""
    for value in ("PRESS", "RELEASE"):
        window().event_simulate(kind, value, x=_mouse[0], y=_mouse[1])
    yield _SETTLE_S


def open_tab():
    """Show the side bar at the add-on's tab, as a person does: no script may choose it."""
    area, bar = view()
    area.spaces.active.show_region_ui = True
    yield 1.0
    likely = bar.y + bar.height - _TAB_PX * bpy.context.preferences.system.ui_scale  # each click draws a tab
    for y in sorted(range(bar.y, bar.y + bar.height, _TAB_STEP_PX), key=lambda y: abs(y - likely)):
        yield from click(bar.x + bar.width - 8, y)
        if bar.active_panel_category == TAB:
            yield 0.5
            return
    raise AssertionError(f"there is no tab {TAB}")


def picture(name):
    """Have the picture of the screen taken (by the test, outside)."""
    wanted = OUT / f"{name}.wanted"
    wanted.touch()
    for _ in range(100):
        yield _PICTURE_WAIT_S
        if not wanted.exists():
            return
    raise AssertionError("nobody took the picture")
