"""What the operators share: one way to report errors, one way to run the engine."""

from pathlib import Path

import bpy
from bpy.props import StringProperty

from ..r2sego_blender.core.errors import R2SEgoError, SceneError, of_file
from ..r2sego_blender.workers.jobs import Job
from . import job, state
from .interruptible import interruptible


def needs_bundle(cls, context) -> bool:
    """Poll of operators that need an open bundle, one that could be read when it was last looked at."""
    if not names_bundle(cls, context):
        return False
    if not context.scene.r2sego.is_read:
        cls.poll_message_set(f"{context.scene.r2sego.problem} Then press Refresh")
        return False
    return True


def names_bundle(cls, context) -> bool:
    """Poll of operators for which it is enough that a bundle was opened."""
    if not context.scene.r2sego.bundle:
        cls.poll_message_set("Open a scene first: press New or Open under Scene")
        return False
    return needs_own_scene(cls, context)


def needs_own_scene(cls, context) -> bool:
    """Poll of operators that put something into the Blender scene."""
    if context.scene.library is not None:
        cls.poll_message_set("This Blender scene is linked from another .blend: work there, or append it")
        return False
    return True


def needs_idle_engine(cls) -> bool:
    """Poll of operators that start the engine."""
    if job.is_running():
        cls.poll_message_set("The engine is busy: wait until it has ended, or cancel it")
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


def require_visible(context, one: bpy.types.Object) -> None:
    """Raise SceneError for an object that is hidden, or whose collection is: Blender lets nobody
    select or edit it."""
    context.view_layer.update()
    if not one.visible_get():
        raise SceneError(f"'{one.name}' is hidden", cure="Show it and its collection in the Outliner.")


def hint_if_hidden(context, one: bpy.types.Object) -> str:
    """What a person is told besides of an object that was just shown, but whose collection is hidden."""
    context.view_layer.update()
    return "" if one.visible_get() else ". It is hidden: show its collection in the Outliner"


def leave_mode(context) -> None:
    """Leave Edit Mode, or another one, before another object becomes the active one: the object would stay
    in it, where neither Tab nor a click reaches it."""
    active = context.view_layer.objects.active
    if active is not None and active.mode != "OBJECT" and bpy.ops.object.mode_set.poll():
        bpy.ops.object.mode_set(mode="OBJECT")


def select_only(context, one: bpy.types.Object) -> None:
    """Select one object, no others, and make it the active one. Raises SceneError for a hidden one."""
    require_visible(context, one)
    if context.view_layer.objects.active != one:
        leave_mode(context)
    for other in list(context.view_layer.objects.selected):
        other.select_set(False)
    one.select_set(True)
    context.view_layer.objects.active = one


def told(error: R2SEgoError | OSError) -> str:
    """The sentence that tells a person of an error. A file that fails on the way is told too: a disk
    is full, or what was there a moment ago is not."""
    if isinstance(error, OSError):
        error = of_file(error)
    line = str(error)
    return line if error.where else job.sentence(line)


def description_of_choice(properties: bpy.types.OperatorProperties, choice: str) -> str:
    """The tooltip of a button that sets an operator's property ``choice``: what is chosen says it."""
    items = properties.bl_rna.properties[choice].enum_items  # a class's own bl_rna does not have them
    return items[getattr(properties, choice)].description


class ReportingOperator:
    """An operator whose ``perform`` may raise R2SEgoError or OSError; it becomes a report and CANCELLED.

    ``perform`` raises before it changes anything, so that undo stays right.
    """

    def execute(self, context):
        try:
            said = self.perform(context)
        except (R2SEgoError, OSError) as error:
            self.report({"ERROR"}, told(error))
            return {"CANCELLED"}
        if said:
            self.report({"INFO"}, said)
        return {"FINISHED"}

    def perform(self, context) -> str:
        """Do the work; return one line for the person, or ''."""
        raise NotImplementedError


class EngineOperator:
    """An operator that runs one command of the engine, as a job that outlives this Blender.

    With a window it starts the job and returns; ``engine/following.py`` follows it from a
    timer and, at its end, calls the same operator again with the same properties and
    ``job_folder``, which calls ``finish``. So it is all one whether this Blender started the
    job or found it. Without a window (``--background``, pip bpy) it waits for the end.

    ``finish`` must find what it needs by the properties, the context and the result.
    """

    job_folder: StringProperty(
        name="Job",
        description="A job that was started before, whose result is taken over",
        options={"HIDDEN", "SKIP_SAVE"},
    )

    def arguments(self, context) -> list[str]:
        """The command line after ``r2sego``, with absolute paths."""
        raise NotImplementedError

    def start(self, context):
        """Start the command; returns the running job."""
        return job.start(self, self.arguments(context))

    def finish(self, context, result) -> str:
        """Take the command's result over; return one line for the person."""
        state.refresh(context.scene)
        return f"{self.bl_label}: done"

    def execute(self, context):
        try:
            if self.job_folder:
                followed = Job.open(Path(self.job_folder))
                job.follow(followed)
            else:
                followed = self.start(context)
        except (R2SEgoError, OSError) as error:
            self.report({"ERROR"}, told(error))
            return {"CANCELLED"}
        if followed.running() and not waits_for_engine(context):
            return {"FINISHED"}
        try:
            with interruptible():
                followed.wait(job.show_event)
        except R2SEgoError:
            pass  # _conclude reports it
        finally:
            ended = self._conclude(context, followed)
        return ended

    def _conclude(self, context, ended_job):
        job.let_go()
        level, ended = "INFO", {"FINISHED"}
        try:
            line = self.finish(context, ended_job.result())
        except (R2SEgoError, OSError) as error:
            # A cancelled command keeps its finished steps: what is there has changed.
            state.refresh(context.scene)
            level, ended = "WARNING" if ended_job.cancelled else "ERROR", {"CANCELLED"}
            line = told(error)
            if "ModuleNotFoundError" in line:
                line += " Press Check Engine: it tells which packages that Python lacks."
            if not ended_job.cancelled:  # on Blender's console, for whoever looks for the cause
                print(*ended_job.words(), sep="\n")
        finally:
            ended_job.forget()
        if line:
            of = job.of_several(state.bundle_path(context.scene))
            job.tell_end(f"{self.bl_label} of {of}" if of else self.bl_label, level, line)
            self.report({level}, line)
        return ended


def waits_for_engine(context) -> bool:
    """Whether an operator waits for the engine, as there is no window that could follow it."""
    return bpy.app.background or not context.window_manager.windows
