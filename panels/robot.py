"""The sub-panel Robot: what is declared, where it may be, what it sits on, and its rollouts."""

import bpy

from .fact_list import FactList, fact_list
from .overlays.region_overlay import REGION
from .sidebar import Sidebar, Step, draw_problem, write_wrapped


class R2SEGO_UL_attempts(FactList, bpy.types.UIList):
    """Attempts at the behaviour; a click on one jumps to where it failed"""

    group, facts = "r2sego_robot", "attempts"

    def draw_fact(self, layout, group, item, index):
        split = layout.split(factor=0.82)
        name = f"{item.number}  {(item.reason or item.behaviour).replace('_', ' ')}"
        row = split.row()
        row.alignment = "LEFT"
        jump = row.operator(
            "r2sego.jump_to_attempt", text=name, emboss=False, icon="CHECKMARK" if item.success else "CANCEL"
        )
        jump.attempt, jump.trial = item.number, group.source == "TRIAL"
        split.label(text=f"{item.time_s:.{0 if item.time_s >= 9.95 else 1}f} s")

    def is_listed(self, group, item):
        return group.listed == "ALL" or item.success == (group.listed == "SUCCEEDED")


def _where(attempt):
    """How far an attempt came, for a line that begins with its number."""
    if not attempt.frames:
        return " never began"
    return f", {attempt.behaviour.replace('_', ' ')}, frame {attempt.frame}"


class R2SEGO_UL_seats(FactList, bpy.types.UIList):
    """Surfaces to sit on; a click on one makes it the target"""

    group, facts = "r2sego_robot", "seats"

    def draw_fact(self, layout, group, item, index):
        place = "{:.3f},{:.3f}".format(*item.place_m)
        text = f"{item.object_name or f'Seat at {place}'}, {item.height_m:.2f} m high"
        row = layout.row()
        row.alignment = "LEFT"
        pick = row.operator("r2sego.pick_target", text=text, emboss=False, icon="HANDLETYPE_VECTOR_VEC")
        pick.target = item.object_name or place


class R2SEGO_PT_robot(Step, bpy.types.Panel):
    """The robot, its behaviour scope and the rollouts"""

    bl_idname = "R2SEGO_PT_robot"
    bl_label = "Robot"
    bl_order = 3
    section = "robot"

    def draw(self, context):
        self.draw_facts(context)
        if context.scene.r2sego_robot.problem:
            draw_problem(context, self.layout, context.scene.r2sego_robot.problem)
        column = self.layout.column(align=True)
        row = column.row(align=True)
        row.operator("r2sego.choose_robot", text="Robot", icon="ARMATURE_DATA")
        row.operator("r2sego.choose_scope", text="Scope", icon="PRESET")
        row = column.row(align=True)
        row.operator("r2sego.set_mount", text="Camera", icon="OUTLINER_DATA_CAMERA")
        row.operator("r2sego.set_behaviours", text="Behaviours", icon="ANIM")
        column.operator("r2sego.inspect_robot", text="Inspect", icon="VIEWZOOM").seats = False


class _Part(Sidebar):
    bl_parent_id = "R2SEGO_PT_robot"
    bl_options = {"DEFAULT_CLOSED"}


class R2SEGO_PT_region(_Part, bpy.types.Panel):
    """Where the robot may be"""

    bl_idname = "R2SEGO_PT_region"
    bl_label = "Behaviour Region"
    bl_order = 0

    def draw_header(self, context):
        self.layout.prop(context.scene.r2sego_robot, "show_region", text="")

    def draw(self, context):
        column = self.layout.column(align=True)
        column.operator("r2sego.draw_region", icon="GREASEPENCIL")
        row = column.row(align=True)
        row.operator("r2sego.region_from_object", text="From Object", icon="MESH_PLANE")
        row.operator("r2sego.clear_region", text="Free Floor", icon="X")
        column.operator("r2sego.set_clearance", text="Clearance", icon="FIXED_SIZE")


class R2SEGO_PT_targets(_Part, bpy.types.Panel):
    """What the robot sits on"""

    bl_idname = "R2SEGO_PT_targets"
    bl_label = "Targets"
    bl_order = 1

    def draw(self, context):
        robot = context.scene.r2sego_robot
        row = self.layout.row(align=True)
        row.operator("r2sego.pick_target", text="Pick", icon="EYEDROPPER").target = ""
        row.operator("r2sego.pick_target", text="Any Seat").target = "any"
        self.layout.operator("r2sego.inspect_robot", text="Find Seats", icon="VIEWZOOM").seats = True
        if len(robot.seats):
            fact_list(self.layout, R2SEGO_UL_seats, robot, "seat_index", rows=2, maxrows=6)


class R2SEGO_PT_rollouts(_Part, bpy.types.Panel):
    """What became of every attempt"""

    bl_idname = "R2SEGO_PT_rollouts"
    bl_label = "Rollouts"
    bl_order = 2

    def draw(self, context):
        layout, robot = self.layout, context.scene.r2sego_robot
        row = layout.row(align=True)
        row.prop(robot, "trial_attempts")
        row.operator("r2sego.try_rollouts", text="Try", icon="PLAY").attempts = robot.trial_attempts
        layout.row(align=True).prop(robot, "source", expand=True)
        if robot.source == "ROUND":
            row = layout.row(align=True)
            row.prop(context.scene.r2sego, "round_index")
            row.operator("r2sego.run_rollouts", text="Run", icon="PLAY").round_index = -1
        if not len(robot.attempts):
            layout.label(text="No rollouts yet", icon="INFO")
            return
        layout.row(align=True).prop(robot, "listed", expand=True)
        fact_list(layout, R2SEGO_UL_attempts, robot, "attempt_index", rows=4, maxrows=10)
        self._draw_chosen(context, robot)

    def _draw_chosen(self, context, robot):
        layout, trial = self.layout, robot.source == "TRIAL"
        layout.label(text=f"{robot.succeeded} of {len(robot.attempts)} succeeded")
        chosen = robot.attempts[min(robot.attempt_index, len(robot.attempts) - 1)]
        write_wrapped(context, layout, f"Attempt {chosen.number}{_where(chosen)}: {chosen.outcome}")
        row = layout.row(align=True)
        one = row.row(align=True)
        one.enabled = chosen.frames > 0
        for part, text, icon, every in ((one, "Show", "ARMATURE_DATA", False), (row, "All", "COMMUNITY", True)):
            show = part.operator("r2sego.show_rollout", text=text, icon=icon)
            show.attempt, show.trial, show.every = chosen.number, trial, every


CLASSES = (
    R2SEGO_UL_attempts,
    R2SEGO_UL_seats,
    R2SEGO_PT_robot,
    R2SEGO_PT_region,
    R2SEGO_PT_targets,
    R2SEGO_PT_rollouts,
)


def register() -> None:
    """Begin to draw the region."""
    REGION.register()


def unregister() -> None:
    """Draw it no longer."""
    REGION.unregister()
