"""Tools that the mouse works in a 3D view: begun, followed while the view is there, and left cleanly."""

import bpy

from ..r2sego_blender.bridge.shared.held_view import HeldView
from ..r2sego_blender.core.errors import R2SEgoError
from .base import told

_GOING_ON = {"RUNNING_MODAL", "PASS_THROUGH"}
_at_work: list["ViewTool"] = []


def leave_tools() -> None:
    """End what is at work: of an add-on that is disabled Blender drops the operators, and tells them nothing."""
    for tool in list(_at_work):
        with bpy.context.temp_override(window=tool.window()):  # the mouse may be in another, as the preferences'
            tool.cancel(bpy.context)


class ViewTool:
    """An operator whose ``invoke`` is ``start_tool``, and which then hears ``on_event`` in one 3D view.

    In both the context's area and region are the view. Keep neither: Blender frees them. The tool
    ends with what ``on_event`` returns, with a sentence when its view is closed or another scene is
    chosen, and silently when another file is opened; ``on_leave`` hears of every end.
    """

    hint = ""
    """What the status bar tells meanwhile."""

    cursor = ""
    """The mouse's picture meanwhile, '' for Blender's own."""

    changed = False
    """Whether it has changed Blender's data already, which an end by itself leaves as it is."""

    _held: HeldView | None = None

    def on_event(self, context, event) -> set[str]:
        """One event; returns what ``modal`` returns. May raise R2SEgoError, which ends the tool."""
        raise NotImplementedError

    def on_start(self, context) -> None:
        """Before the first event. May raise R2SEgoError, which refuses."""

    def in_midst(self) -> bool:
        """Whether it goes on where it is when the mouse comes to another quarter of a quad view."""
        return False

    def on_leave(self, context) -> None:
        """After the last event, however it ended; there may be no view any more."""

    def start_tool(self, context) -> set[str]:
        """Begin, in the 3D view whose button or side bar was used."""
        refusal = _refusal(context, self.bl_label)
        if refusal:
            self.report({"ERROR"}, refusal)
            return {"CANCELLED"}
        self._held = HeldView(context.area, context.scene)
        try:
            area, region = self._held.places(context.screen)
            with context.temp_override(area=area, region=region):  # the button may stand in the side bar
                self.on_start(context)
        except (R2SEgoError, OSError) as error:
            self.report({"ERROR"}, told(error))
            return {"CANCELLED"}
        context.workspace.status_text_set(self.hint or None)
        if self.cursor:
            context.window.cursor_modal_set(self.cursor)
        context.window_manager.modal_handler_add(self)
        _at_work.append(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        lost = self._held.lost(context)
        if lost:
            self._leave(context)
            self.report({"WARNING"}, f"{self.bl_label} ended: {lost}. Start it again where you work now")
            return self._left()
        if not self.in_midst():
            self._held.turn_to_mouse(context.screen, event)
        area, region = self._held.places(context.screen)
        ended = set()
        try:
            with context.temp_override(area=area, region=region):
                ended = self.on_event(context, event)
        except (R2SEgoError, OSError) as error:
            self.report({"ERROR"}, told(error))
            ended = self._left()
        finally:
            if not ended & _GOING_ON:
                self._leave(context)
        return ended

    def window(self) -> bpy.types.Window | None:
        """The window that shows the view it works in, None where none does any more."""
        windows = bpy.context.window_manager.windows
        return next((one for one in windows if self._held.places(one.screen) is not None), None)

    def cancel(self, context):
        """Blender ends the operator, for example because another file is opened."""
        self._leave(context)

    def _left(self) -> set[str]:
        return {"FINISHED" if self.changed else "CANCELLED"}  # what changed can be undone

    def _leave(self, context) -> None:
        if self in _at_work:
            _at_work.remove(self)
        self.on_leave(context)
        if context.window is not None:
            if self.cursor:
                context.window.cursor_modal_restore()
            context.workspace.status_text_set(None)


def _refusal(context, label: str) -> str:
    """Why the tool of that label cannot begin here, '' when it can."""
    if context.area is None or context.area.type != "VIEW_3D":
        return f"Press {label} in a 3D view"
    for other in context.window.modal_operators:
        if other is not None and other.bl_idname.startswith("R2SEGO_OT_"):  # None: its add-on was disabled
            return f"{other.bl_label} is still at work: end it with ESC first"
    return ""
