"""The buttons that the add-on's panels draw, recorded inside Blender by the window tests."""

from functools import partial
from types import FunctionType, MethodType

import bpy
import hand  # found beside this file

PANELS = "R2SEGO_PT"


class Drawn:
    """The buttons that the add-on's panels draw: their layouts are recorded while they draw."""

    def __init__(self, open_sections=False):
        """``open_sections`` draws the panels within panels open, which are closed at first."""
        self.drawn = {}
        self._open_sections = open_sections
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
        hand.view()[1].tag_redraw()
        for _ in range(20):
            yield 0.2
            if len(self.drawn) > 1:
                break
        yield 0.2

    def _panel_draw(self, draw, name):
        def recorded(panel, context):
            self._now = []
            draw(_StandIn(panel, self._recorded(panel.layout)), context)
            # Only now: properties are set after the button was made.
            self.drawn[name] = [(call_of(made, _given(values)), menu) for made, values, menu in self._now]

        return recorded

    def _list_draw(self, draw_item):
        # Within the draw of a panel. Blender gives as many arguments as are written here.
        def recorded(shown, context, layout, data, item, icon, active_data, active_property, index):
            layout = self._recorded(layout)
            draw_item(shown, context, layout, data, item, icon, active_data, active_property, index)

        return recorded

    def _recorded(self, layout):
        return _Recorded(layout, self._now, self._open_sections)


class _StandIn:
    """A panel with another layout, which Blender lets no panel have."""

    def __init__(self, panel, layout):
        self._panel, self.layout = panel, layout

    def __getattr__(self, name):
        found = getattr(type(self._panel), name)
        return MethodType(found, self) if isinstance(found, FunctionType) else found


class _Recorded:
    """A layout and those made from it, whose add-on's buttons are noted: (name, properties, menu)."""

    def __init__(self, layout, notes, open_sections):
        vars(self).update(_layout=layout, _notes=notes, _open_sections=open_sections)

    def __setattr__(self, name, value):
        setattr(self._layout, name, value)

    def __getattr__(self, name):
        found = getattr(self._layout, name)
        return partial(self._call, name, found) if callable(found) else found

    def _call(self, method, function, *arguments, **named):
        if method == "panel" and self._open_sections:
            named["default_closed"] = False
        answer = function(*arguments, **named)
        if method in ("operator", "operator_menu_enum") and arguments[0].startswith("r2sego."):
            self._notes.append((arguments[0], answer, method != "operator"))
        if isinstance(answer, tuple):  # a panel in the layout: its heading and its body, if it is open
            return tuple(self._of(each) for each in answer)
        return self._of(answer)

    def _of(self, answer):
        if isinstance(answer, bpy.types.UILayout):
            return _Recorded(answer, self._notes, self._open_sections)
        return answer


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


def name_of(call):
    """The operator's identifier in a Python call: ``r2sego.refine``."""
    return call.removeprefix("bpy.ops.").partition("(")[0]
