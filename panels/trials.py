"""The sub-panel Trials: a study on a real robot, its running session, and what came of it so far."""

import math

import bpy

from .sidebar import Sidebar, Step, draw_problem, write_facts, write_wrapped

_OUTCOMES = {
    "SUCCESS": ("SUCCESS", "CHECKMARK"),
    "FAILURE": ("FAILURE", "CANCEL"),
    "UNUSABLE": ("UNUSABLE: run again", "ERROR"),
}
_BUTTONS = {
    "SET_UP": (("ARM", "Arm", "REC"),),
    "ARMED": (("START", "Start", "PLAY"),),
    "RUNNING": (("END", "End", "SNAP_FACE"), ("INTERVENE", "Intervention", "HAND")),
    "JUDGED": (("NEXT", "Next", "FORWARD"),),
    "SELF_TEST": (("NEXT", "Test Again", "FILE_REFRESH"),),
}
"""What an operator may do next, by the session's state: the control, the button, its icon."""


def told_pose(pose):
    """A pose in words."""
    x, y, heading_deg = pose
    return f"{x:.2f}, {y:.2f} m, {heading_deg:.0f}\N{DEGREE SIGN}"


class R2SEGO_PT_trials(Step, bpy.types.Panel):
    """Trials on a real robot, judged by sensors"""

    bl_idname = "R2SEGO_PT_trials"
    bl_label = "Trials"
    bl_order = 9
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, group = self.layout, context.scene.r2sego_trials
        facts = group.facts
        row = layout.row(align=True)
        row.operator("r2sego.plan_trials", text="New", icon="FILE_NEW")
        row.operator("r2sego.open_study", text="Open", icon="FILE_FOLDER")
        if facts.problem:
            draw_problem(context, layout, facts.problem)
        if facts.plan is None:
            return
        self._draw_study(context, facts, group.live)
        if group.live is None:
            self._draw_start(layout, group, facts)
        else:
            self._draw_live(context, group.live, facts.plan.rules)

    def _draw_study(self, context, facts, live):
        plan, column = facts.plan, self.layout.column(align=True)
        lines = [("Study", plan.name), ("Plan", f"{len(plan.trials)} trials, {plan.digest[:12]}")]
        if facts.state.ended:
            lines.append(("Ended", f"{facts.state.ended[:10]}: {facts.state.reason}"))
        elif live is None:
            following = facts.next
            told = f"Trial {following.number}: {following.label}" if following is not None else "Every trial was run"
            lines.append(("Next", told))
        write_facts(context, column, lines)
        row = self.layout.row(align=True)
        row.operator("r2sego.show_trial_poses", text="Poses", icon="EMPTY_ARROWS")
        row.operator("r2sego.open_trials_page", text="Page", icon="FILE_TEXT")

    def _draw_start(self, layout, group, facts):
        if facts.state.ended:
            return
        column = layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        column.prop(group, "simulated")
        if not group.simulated:
            for name in ("device", "adapter", "baud", "calibration"):
                column.prop(group, name)
        layout.label(text="The emergency stop is a circuit", icon="ERROR")
        row = layout.row()
        row.scale_y = 1.2
        row.operator("r2sego.run_trials", text="Run", icon="PLAY")
        layout.operator("r2sego.end_study", icon="X")

    def _draw_live(self, context, live, rules):
        layout = self.layout
        title = f"{'Simulated: ' if live.simulated else ''}trial {live.index + 1} of {live.total}, {live.state.value}"
        layout.label(text=title[:1].upper() + title[1:], icon="REC" if live.record else "DOT")
        if live.emergency_stop:
            draw_problem(context, layout, "The emergency circuit is open")
        write_wrapped(context, layout, live.next, "INFO")
        tether = "stays on" if live.tethered else "detached"
        write_facts(
            context,
            layout.column(align=True),
            [
                ("Policy", live.label),
                ("Tether", tether),
                ("Robot", told_pose(live.robot_pose)),
                (live.chair[:1].upper() + live.chair[1:], told_pose(live.chair_pose)),
            ],
        )
        self._draw_signals(layout, live, rules)
        if live.outcome is not None and live.state.name in ("JUDGED", "SET_UP", "FINISHED"):
            self._draw_outcome(context, live)
        self._draw_buttons(layout, live)

    def _draw_signals(self, layout, live, rules):
        column = layout.column(align=True)
        for name, newtons in live.newtons:
            limit = rules.tether_n if name.startswith("tether") else rules.seat_n
            share = newtons / limit if math.isfinite(newtons) else 0.0
            row = column.row()
            row.alert = name.startswith("tether") and share > 1.0
            told = f"{newtons:.1f} N" if math.isfinite(newtons) else "not calibrated"
            row.progress(factor=min(1.0, max(0.0, share)), text=f"{name.replace('_', ' ').capitalize()} {told}")
        support = f"Support {live.support_s:.1f} of {rules.support_s:g} s"
        column.progress(factor=min(1.0, live.support_s / rules.support_s), text=support)
        row = column.row()
        row.label(text=f"{live.elapsed_s:.1f} s", icon="TIME")
        lost = row.row()
        lost.alert = live.lost_share > rules.max_loss
        lost.label(text=f"{live.rate_hz:.0f} Hz, {live.lost_share:.1%} lost")

    def _draw_outcome(self, context, live):
        text, icon = _OUTCOMES[live.outcome.name]
        box = self.layout.box()
        row = box.row()
        row.scale_y, row.alert = 2.0, live.outcome.name != "SUCCESS"
        row.label(text=text, icon=icon)
        for reason in live.reasons:
            write_wrapped(context, box, reason)

    def _draw_buttons(self, layout, live):
        row = layout.row(align=True)
        row.scale_y = 1.5
        for control, text, icon in _BUTTONS.get(live.state.name, ()):
            row.operator("r2sego.tell_session", text=text, icon=icon).control = control
        recorded = live.state.name in ("ARMED", "RUNNING", "ENDED", "JUDGED")
        column = layout.column(align=True)
        row = column.row(align=True)
        for control, text, sense in (
            ("NOTE", "Note", recorded),
            ("VIDEO", "Video", recorded),
            ("ABORT", "Abort", live.state.name in ("ARMED", "RUNNING")),
        ):
            _sensible(row, sense).operator("r2sego.tell_session", text=text).control = control
        row = column.row(align=True)
        _sensible(row, live.state.name == "JUDGED").operator("r2sego.judge_trial", text="Judge")
        row.operator("r2sego.tell_session", text="Stop", icon="PAUSE").control = "STOP"


def _sensible(row, sense):
    """A part of the row whose button is grey where the session would pass it over."""
    part = row.row(align=True)
    part.enabled = sense
    return part


class R2SEGO_PT_trial_counts(Sidebar, bpy.types.Panel):
    """Successes by condition, hidden while the operator is blinded"""

    bl_idname = "R2SEGO_PT_trial_counts"
    bl_label = "Counts"
    bl_parent_id = "R2SEGO_PT_trials"

    @classmethod
    def poll(cls, context):
        return context.scene.r2sego_trials.live is not None

    def draw(self, context):
        counts = context.scene.r2sego_trials.live.counts
        if counts is None:
            self.layout.label(text="Hidden until the end: blinded", icon="HIDE_ON")
            return
        lines = [
            (one.condition, f"{one.successes} of {one.trials}" + (f", {one.unusable} unusable" if one.unusable else ""))
            for one in counts
        ]
        write_facts(context, self.layout.column(align=True), lines)


CLASSES = (R2SEGO_PT_trials, R2SEGO_PT_trial_counts)
