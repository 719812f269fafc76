"""What the operators share: one way to report errors, one way to follow the engine."""

import bpy

from ..r2sego_blender.bridge.views_3d import redraw_views
from ..r2sego_blender.errors import R2SEgoError
from . import job, state

_TICK_S = 0.2


def needs_bundle(cls, context) -> bool:
    """Poll of operators that need an open bundle."""
    if not context.scene.r2sego.bundle:
        cls.poll_message_set("Open a scene first")
        return False
    return True


def needs_idle_engine(cls) -> bool:
    """Poll of operators that start the engine."""
    if job.is_running():
        cls.poll_message_set("The engine is busy: wait, or cancel it")
        return False
    return True


def needs_round(cls, context) -> bool:
    """Poll of operators that show what a round left."""
    if not needs_bundle(cls, context):
        return False
    if context.scene.r2sego.rounds_begun == 0:
        cls.poll_message_set("Nothing refined yet: run Refine first")
        return False
    return True


class ReportingOperator:
    """An operator whose ``perform`` may raise R2SEgoError; it becomes a report and CANCELLED.

    ``perform`` raises before it changes anything, so that undo stays right.
    """

    def execute(self, context):
        try:
            said = self.perform(context)
        except R2SEgoError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if said:
            self.report({"INFO"}, said)
        return {"FINISHED"}

    def perform(self, context) -> str:
        """Do the work; return one line for the person, or ''."""
        raise NotImplementedError


class EngineOperator:
    """An operator that runs one command of the engine.

    With a window it follows the command from a timer and ESC cancels it; without one
    (``--background``, pip bpy) it waits for the end.
    """

    _timer = None
    _engine = None

    def arguments(self, context) -> list[str]:
        """The command line after ``r2sego``, with absolute paths."""
        raise NotImplementedError

    def start(self, context):
        """Start the command; returns the running engine."""
        return job.start(self.arguments(context), self.bl_label)

    def finish(self, context, result) -> str:
        """Take the command's result over; return one line for the person."""
        state.refresh(context.scene)
        return f"{self.bl_label}: done"

    def execute(self, context):
        try:
            self._engine = self.start(context)
        except R2SEgoError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if bpy.app.background or context.window is None:
            try:
                self._engine.wait(job.show_event)
            except R2SEgoError:
                pass  # _conclude reports it
            finally:
                ended = self._conclude(context)
            return ended
        manager = context.window_manager
        self._timer = manager.event_timer_add(_TICK_S, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        shown = context.window_manager.r2sego_job
        if event.type == "ESC" and event.value == "PRESS":
            shown.cancel_requested = True
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if shown.cancel_requested and not self._engine.cancelled:
            self._engine.cancel()
            shown.task = "Cancelling"
        for told in self._engine.events():
            job.show_event(told)
        if self._engine.running():
            self._redraw(context, f"R2S-EGO: {job.progress_text()} (ESC cancels)")
            return {"PASS_THROUGH"}
        self._leave(context)
        return self._conclude(context)

    def cancel(self, context):
        """Blender ends the operator, for example because another file is opened."""
        self._leave(context)
        job.end()

    def _conclude(self, context):
        engine = self._engine
        job.end()
        try:
            said = self.finish(context, engine.result())
        except R2SEgoError as error:
            # A cancelled command keeps its finished steps: what is there has changed.
            state.refresh(context.scene)
            self.report({"WARNING" if engine.cancelled else "ERROR"}, str(error))
            return {"CANCELLED"}
        if said:
            self.report({"INFO"}, said)
        return {"FINISHED"}

    def _leave(self, context) -> None:
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        self._redraw(context, None)

    def _redraw(self, context, status) -> None:
        if context.workspace is not None:
            context.workspace.status_text_set(status)
        redraw_views("UI")  # the side bar alone: a large scene is slow to draw
