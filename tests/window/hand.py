"""A hand on Blender's mouse, used inside Blender by the window tests: it moves, clicks and looks.

Blender is started with ``--enable-event-simulate``. A script is a generator that yields the
seconds it waits, so that Blender draws and answers in between.
"""

import re
import sys
import traceback
from pathlib import Path

import bpy

OUT = Path(sys.argv[sys.argv.index("--") + 1])
TAB = "R2S-EGO"
_SETTLE_S = 0.15
_TAB_STEP_PX = 10
_PICTURE_WAIT_S = 0.1


def perform(script):
    """Run the generator ``script`` from a timer; quit Blender at its end, with its error in the log."""

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
    window().event_simulate("MOUSEMOVE", "NOTHING", x=int(x), y=int(y))
    yield 0.05


def click(x, y):
    """Click the left button there."""
    yield from move(x, y)
    for value in ("PRESS", "RELEASE"):
        window().event_simulate("LEFTMOUSE", value, x=int(x), y=int(y))
    yield _SETTLE_S


def key(kind):
    """Press and release a key where the mouse is."""
    for value in ("PRESS", "RELEASE"):
        window().event_simulate(kind, value)
    yield _SETTLE_S


def open_tab():
    """Show the side bar at the add-on's tab, as a person does: no script may choose it."""
    area, bar = view()
    area.spaces.active.show_region_ui = True
    yield 1.0
    for y in range(bar.y + bar.height - 5, bar.y, -_TAB_STEP_PX):
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


class Drawn:
    """What the add-on's panels draw, read from their layouts while they draw."""

    def __init__(self):
        self.layouts = {}
        for cls in panels():
            cls.draw = self._listening(cls.draw, cls.__name__)

    def operators(self):
        """The identifiers of the operators whose buttons stand in the panels."""
        text = str(self.layouts)
        return sorted(set(re.findall(r"bpy\.ops\.(r2sego\.\w+)\(", text)))

    def _listening(self, draw, name):
        def listening(panel, context):
            draw(panel, context)
            self.layouts[name] = panel.layout.introspect()

        return listening


def panels():
    """The add-on's panels in the side bar."""
    return [cls for cls in bpy.types.Panel.__subclasses__() if cls.__name__.startswith("R2SEGO_PT")]


def open_all_panels():
    """Register the closed sub-panels anew as open ones: all that can be drawn is drawn."""
    closed = [cls for cls in panels() if "DEFAULT_CLOSED" in getattr(cls, "bl_options", set())]
    for cls in closed:
        bpy.utils.unregister_class(cls)
        cls.bl_options = set(cls.bl_options) - {"DEFAULT_CLOSED"}
    for cls in closed:
        bpy.utils.register_class(cls)


def operator_under_mouse():
    """The operator of the button under the mouse, '' when there is none."""
    area, bar = view()
    manager = bpy.context.window_manager
    manager.clipboard = ""
    with bpy.context.temp_override(window=window(), area=area, region=bar):
        if bpy.ops.ui.copy_python_command_button.poll():
            bpy.ops.ui.copy_python_command_button()
    found = re.match(r"bpy\.ops\.(r2sego\.\w+)\(", manager.clipboard)
    return found.group(1) if found else ""


def sweep(step_px, columns):
    """Move over the whole side bar; returns {operator: (x, y)} of each button first met."""
    _, bar = view()
    met = {}
    for y in range(bar.y + bar.height - 4, bar.y, -step_px):
        for share in columns:
            x = bar.x + share * bar.width
            yield from move(x, y)
            name = operator_under_mouse()
            if name:
                met.setdefault(name, (int(x), y))
    return met
