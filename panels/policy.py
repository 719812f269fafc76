"""The sub-panel Policy below Robot: a policy's evaluation in the scene, its episodes, where they began."""

from pathlib import Path

import bpy

from ..r2sego_blender.bridge.robot.show_starts import colours
from .fact_list import FactList, fact_list
from .overlays.swatches import swatch
from .sidebar import Sidebar, write_facts, write_wrapped


class R2SEGO_UL_policy_episodes(FactList, bpy.types.UIList):
    """Episodes of the policy; a click on one shows it on the timeline"""

    group, facts = "r2sego_robot", "episodes"

    def draw_fact(self, layout, group, item, index):
        split = layout.split(factor=0.82)
        row = split.row()
        row.alignment = "LEFT"
        name = f"{item.number}  {(item.reason or 'success').replace('_', ' ')}"
        icon = "CHECKMARK" if item.success else "CANCEL"
        row.operator("r2sego.show_policy_episode", text=name, emboss=False, icon=icon).episode = item.number
        split.label(text=f"{item.time_s:.0f} s")


class R2SEGO_PT_policy(Sidebar, bpy.types.Panel):
    """How often a policy succeeds in the scene, and how each episode went"""

    bl_idname = "R2SEGO_PT_policy"
    bl_label = "Policy"
    bl_parent_id = "R2SEGO_PT_robot"
    bl_order = 3
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, robot = self.layout, context.scene.r2sego_robot
        layout.prop(robot, "policy", text="", placeholder="The teacher")
        row = layout.row(align=True)
        row.prop(robot, "policy_episodes")
        evaluate = row.operator("r2sego.evaluate_policy", text="Evaluate", icon="PLAY")
        evaluate.policy, evaluate.episodes = robot.policy, robot.policy_episodes
        found = robot.evaluation
        if found is None:
            layout.label(text="Not evaluated yet", icon="INFO")
            return
        self._draw_figures(context, found)
        layout.operator("r2sego.show_policy_starts", text="Starts on the Floor", icon="EMPTY_SINGLE_ARROW")
        column = layout.column(align=True)
        ends = found.by_end
        for end, colour in colours(list(ends)).items():
            split = column.split(factor=0.82)
            split.label(text=(end or "success").replace("_", " ").capitalize(), icon_value=swatch(colour))
            split.label(text=str(ends[end]))
        fact_list(layout, R2SEGO_UL_policy_episodes, robot, "episode_index", rows=4, maxrows=10)
        self._draw_chosen(context, robot)

    def _draw_figures(self, context, found):
        share, low, high = (round(100.0 * part) for part in (found.successes / found.episodes, found.low, found.high))
        lines = [
            ("Policy", "the teacher, which knows the true state" if found.policy == "teacher" else found.policy_name),
            ("Success", f"{found.successes} of {found.episodes}, {share} % [{low}, {high}]"),
            ("Driver", found.driver),
            ("Mean Assist", f"{found.mean_assist_n:.1f} N on the base"),
        ]
        if found.asset:
            lines.append(("Seen Through", Path(found.asset).name))
        if found.reference:
            lines.append(("Reference Room", Path(found.reference).name))
        if found.chairs:
            lines.append(("Chairs", ", ".join(found.chairs)))
        write_facts(context, self.layout.column(align=True), lines)

    def _draw_chosen(self, context, robot):
        chosen = robot.episodes[min(robot.episode_index, len(robot.episodes) - 1)]
        told = f"Episode {chosen.number}: {chosen.outcome}, mean assist {chosen.assist_n:.1f} N"
        write_wrapped(context, self.layout, told)
        row = self.layout.row(align=True)
        show = row.operator("r2sego.show_policy_episode", text="Show", icon="ARMATURE_DATA")
        show.episode = chosen.number
        head = row.operator("r2sego.show_policy_episode", text="Head", icon="IMAGE_DATA")
        head.episode, head.in_editor = chosen.number, True


CLASSES = (R2SEGO_UL_policy_episodes, R2SEGO_PT_policy)
