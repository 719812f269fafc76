"""Finds the buttons of the side bar with the mouse, used inside Blender by the window tests."""

import ast
from collections import Counter
from itertools import product

import bpy
import drawn_buttons  # found beside this file
import hand

_RASTER_PX = 10  # at interface scale 1; the smallest button is 20 wide and high
_MOVES = 3  # with the first the mouse leaves one button, with the second it is over the next
_BURST = 600
_MENU_TRIES = 24
_TRIES_A_ROW = 2
_CONTENT = 0.9  # of the bar's width
_WAIT_S = 120.0


def under_mouse():
    """The button's operator as a Python call, "property" for a field, "" for all else."""
    area, bar = hand.view()
    manager = bpy.context.window_manager
    manager.clipboard = ""
    with bpy.context.temp_override(window=hand.window(), area=area, region=bar):
        if bpy.ops.ui.copy_python_command_button.poll():
            bpy.ops.ui.copy_python_command_button()
            call = ast.parse(manager.clipboard, mode="eval").body
            given = {word.arg: ast.literal_eval(word.value) for word in call.keywords}
            return drawn_buttons.call_of(ast.unparse(call.func).removeprefix("bpy.ops."), given)
        return "property" if bpy.ops.ui.copy_data_path_button.poll() else ""


class TEST_OT_hover(bpy.types.Operator):  # noqa: N801
    """Notes what is under the mouse at each of many places without a redraw in between.

    It sees each move before the side bar does, so what is under the mouse then is what
    the move before met.
    """

    bl_idname, bl_label = "test.hover", "Hover"

    met: dict = {}  # noqa: RUF012
    left: list = []  # noqa: RUF012

    def invoke(self, context, event):
        self._last, self._moves = None, 0
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type != "MOUSEMOVE":
            return {"PASS_THROUGH"}
        place = (event.mouse_x, event.mouse_y)
        self._moves = self._moves + 1 if place == self._last else 1
        self._last = place
        if self._moves == _MOVES and self.left and place == self.left[0]:
            self.met[self.left.pop(0)] = under_mouse()
        return {"PASS_THROUGH"} if self.left else {"FINISHED"}


def hover(places):
    """Move to each place; {(x, y): what is under the mouse there, as under_mouse tells it}."""
    met = {}
    for begin in range(0, len(places), _BURST):
        burst = places[begin : begin + _BURST]
        TEST_OT_hover.left[:], TEST_OT_hover.met = burst, met
        with bpy.context.temp_override(window=hand.window()):
            bpy.ops.test.hover("INVOKE_DEFAULT")
        for x, y in burst:
            for _ in range(_MOVES):
                hand.window().event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
        for _ in range(int(_WAIT_S / 0.02)):
            yield 0.02
            if not TEST_OT_hover.left:
                break
    return met


def find(wanted, scale):
    """Move over the side bar from above until every call of ``wanted`` was met.

    Returns {call: (x, y)}, and the places where neither an operator's button nor a
    property is: what opens a menu is among them.
    """
    _, bar = hand.view()
    step = int(_RASTER_PX * scale)
    # Neither the bar's edge, which a click might drag, nor the tabs.
    columns = range(bar.x + 2 * step, bar.x + int(_CONTENT * bar.width), step)
    rows = range(bar.y + bar.height - step // 2, bar.y, -step)
    met, silent = {}, []
    each = max(1, _BURST // len(columns))
    for begin in range(0, len(rows), each):
        places = [(x, y) for y in rows[begin : begin + each] for x in columns]
        for place, call in (yield from hover(places)).items():
            if call:
                met.setdefault(call, []).append(place)
            else:
                silent.append(place)
        if wanted <= met.keys():
            break
    return {call: _middle(places) for call, places in met.items()}, silent


def _middle(places):
    """The place amid the first button's."""
    return places[len([place for place in places if place[1] == places[0][1]]) // 2]


def beside(call, drawn, met, silent):
    """The places of ``silent`` between the buttons drawn before and after ``call``, the nearest first.

    Two a row: between two rows of buttons there may be a row of places that are on nothing.
    """
    at = drawn.index(call)
    before = [met[other] for other in drawn[:at] if other in met][-1:]
    after = [met[other] for other in drawn[at + 1 :] if other in met][:1]
    between = [
        (x, y)
        for x, y in silent
        if all(y < top or (y == top and x > left) for left, top in before)
        and all(y > low or (y == low and x < right) for right, low in after)
    ]
    # A row below stands often in the next panel, whose heading would be clicked.
    beside_it = before + [place for place in after if place[1] in {y for _, y in between}]
    far = {(x, y): min(abs(y - b) + abs(x - a) for a, b in beside_it or after) for x, y in between}
    rows = Counter()
    tries = []
    for place in sorted(between, key=far.get):
        rows[place[1]] += 1
        if rows[place[1]] <= _TRIES_A_ROW:
            tries.append(place)
    return tries[:_MENU_TRIES]


def open_menu(call, places, scale):
    """Click at ``places`` one after the other until a menu opens that has the operator of ``call``.

    Returns where its first entry is, None if none opened; the menu stays open.
    """
    step = int(_RASTER_PX * scale)
    for (x, y), way in product(places, (-1, 1)):  # it opens below or above, and closes when it is left far
        yield from hand.click(x, y)
        for off in range(0, 6 * step, step):
            place = (x, y + way * off)
            other = (yield from hover([place])).get(place, "")
            if drawn_buttons.name_of(other) == drawn_buttons.name_of(call) and other != call:
                return place
        yield from hand.key("ESC")
    return None


bpy.utils.register_class(TEST_OT_hover)
