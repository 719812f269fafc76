"""A hand on Blender's mouse, used inside Blender by the window tests: it moves, clicks and looks.

Blender is started with ``--enable-event-simulate``. A script is a generator that yields the
seconds it waits, so that Blender draws and answers in between.
"""

import ast
import sys
import traceback
from functools import partial
from pathlib import Path
from types import FunctionType, MethodType

import bpy

OUT = Path(sys.argv[sys.argv.index("--") + 1])
TAB = "R2S-EGO"
PANELS = "R2SEGO_PT"
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


class Drawn:
    """The buttons that the add-on's panels draw: their layouts are recorded while they draw."""

    def __init__(self, open_sections=False):
        """``open_sections`` draws the panels within panels open, which are closed at first."""
        _Recorded.open_sections = open_sections
        self.drawn = {}
        self._now = []  # of the panel that draws
        for cls in panels():
            cls.draw = self._panel_draw(cls.draw, cls.__name__)
        for cls in bpy.types.UIList.__subclasses__():
            if cls.__name__.startswith("R2SEGO_UL"):
                cls.draw_item = self._list_draw(cls.draw_item)

    def buttons(self):
        """The buttons as Python calls, in the order of drawing: {call: whether it opens a menu}."""
        return {call: menu for buttons in self.drawn.values() for call, menu in buttons}

    def anew(self):
        """Draw again and forget what is drawn no longer."""
        self.drawn.clear()
        view()[1].tag_redraw()
        for _ in range(20):
            yield 0.2
            if len(self.drawn) > 1:
                break
        yield 0.2

    def _panel_draw(self, draw, name):
        def recorded(panel, context):
            self._now = []
            draw(_StandIn(panel, _Recorded(panel.layout, self._now)), context)
            # Only now: properties are set after the button was made.
            self.drawn[name] = [(call_of(made, _given(values)), menu) for made, values, menu in self._now]

        return recorded

    def _list_draw(self, draw_item):
        # Within the draw of a panel. Blender gives as many arguments as are written here.
        def recorded(shown, context, layout, data, item, icon, active_data, active_property, index):
            layout = _Recorded(layout, self._now)
            draw_item(shown, context, layout, data, item, icon, active_data, active_property, index)

        return recorded


class _StandIn:
    """A panel with another layout, which Blender lets no panel have."""

    def __init__(self, panel, layout):
        self._panel, self.layout = panel, layout

    def __getattr__(self, name):
        found = getattr(type(self._panel), name)
        return MethodType(found, self) if isinstance(found, FunctionType) else found


class _Recorded:
    """A layout and those made from it, whose add-on's buttons are noted: (name, properties, menu)."""

    open_sections = False

    def __init__(self, layout, notes):
        vars(self).update(_layout=layout, _notes=notes)

    def __setattr__(self, name, value):
        setattr(self._layout, name, value)

    def __getattr__(self, name):
        found = getattr(self._layout, name)
        return partial(self._call, name, found) if callable(found) else found

    def _call(self, method, function, *arguments, **named):
        if method == "panel" and self.open_sections:
            named["default_closed"] = False
        answer = function(*arguments, **named)
        if method in ("operator", "operator_menu_enum") and arguments[0].startswith("r2sego."):
            self._notes.append((arguments[0], answer, method != "operator"))
        if isinstance(answer, tuple):  # a panel in the layout: its heading and its body, if it is open
            return tuple(self._of(each) for each in answer)
        return self._of(answer)

    def _of(self, answer):
        return _Recorded(answer, self._notes) if isinstance(answer, bpy.types.UILayout) else answer


def _given(properties):
    """What was set of an operator's properties: {name: value}."""
    names = [each.identifier for each in properties.bl_rna.properties if each.identifier != "rna_type"]
    return {name: getattr(properties, name) for name in names if properties.is_property_set(name)}


def call_of(name, given):
    """An operator's Python call, written in one way whoever tells it."""
    return f"bpy.ops.{name}({', '.join(f'{key}={_written(given[key])}' for key in sorted(given))})"


def _written(value):
    """A value as text; Blender writes six digits of a number."""
    if isinstance(value, float):
        return f"{value:g}"
    return repr(sorted(value) if isinstance(value, set) else value)


def panels(of=PANELS):
    """The add-on's panels in the side bar whose names begin so."""
    return [cls for cls in bpy.types.Panel.__subclasses__() if cls.__name__.startswith(of)]


def open_panels(of=PANELS):
    """Register the closed sub-panels whose names begin with ``of`` anew as open ones."""
    closed = [cls for cls in panels(of) if "DEFAULT_CLOSED" in getattr(cls, "bl_options", set())]
    for cls in closed:
        bpy.utils.unregister_class(cls)
        cls.bl_options = set(cls.bl_options) - {"DEFAULT_CLOSED"}
    for cls in closed:
        bpy.utils.register_class(cls)


def under_mouse():
    """The button's operator as a Python call, "property" for a field, "" for all else."""
    area, bar = view()
    manager = bpy.context.window_manager
    manager.clipboard = ""
    with bpy.context.temp_override(window=window(), area=area, region=bar):
        if bpy.ops.ui.copy_python_command_button.poll():
            bpy.ops.ui.copy_python_command_button()
            call = ast.parse(manager.clipboard, mode="eval").body
            given = {word.arg: ast.literal_eval(word.value) for word in call.keywords}
            return call_of(ast.unparse(call.func).removeprefix("bpy.ops."), given)
        return "property" if bpy.ops.ui.copy_data_path_button.poll() else ""


def name_of(call):
    """The operator's identifier in a Python call: ``r2sego.refine``."""
    return call.removeprefix("bpy.ops.").partition("(")[0]
