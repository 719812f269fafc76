"""Have MuJoCo check the collision surface."""

import bpy

from ...r2sego_blender.bridge.collision.show_collision_check import show_off_surface
from ...r2sego_blender.bridge.shared.panel_facts import facts_of
from ...r2sego_blender.core.formatting import counted
from .. import state
from ..base import EngineOperator, needs_idle_engine
from .polls import needs_collision
from .properties import CollisionFacts, tell


class R2SEGO_OT_check_collision(EngineOperator, bpy.types.Operator):
    """Drop spheres on the collision surface in MuJoCo, and see whether the robot stands on it"""

    bl_idname = "r2sego.check_collision"
    bl_label = "Check Collision"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        return needs_collision(cls, context) and needs_idle_engine(cls)

    def arguments(self, context):
        return ["check-collision", str(state.opened_bundle(context).path), "--json-progress"]

    def finish(self, context, result):
        group, bundle = context.scene.r2sego_collision, state.opened_bundle(context)
        state.read_again(context.scene, CollisionFacts)
        group.check_of = facts_of(context.scene, CollisionFacts).surface
        group.check_passed = bool(result.get("passed"))
        tell(group.check_lines, _facts(result))
        off = show_off_surface(context.scene, bundle, result.get("off_surface", ()))
        verdict = "The collision surface passed" if group.check_passed else "The collision surface did not pass"
        return f"{verdict}; spheres off it are marked at {counted(len(off), 'place')}" if off else verdict


def _facts(result) -> list[tuple[str, str]]:
    """The report's figures as labels and values; those that are not there are left out."""
    spheres = result.get("spheres")
    facts = []
    if "pieces" in result:
        facts.append(("Pieces", f"{result['pieces']}, exact to {1e3 * result['vertex_error_m']:.2g} mm"))
    if spheres is not None:
        facts += [
            ("Spheres", f"{result['at_rest']} of {spheres} at rest, {result['fell_through']} fell through"),
            ("Within 1 cm", f"{result['rest_within_1_cm']} of {spheres}"),
        ]
    gaps_m = [abs(one["gap_m"]) for one in result.get("off_surface", ()) if one["gap_m"] is not None]
    if gaps_m:
        facts.append(("Farthest", f"{100.0 * max(gaps_m):.1f} cm off"))
    if result.get("robot_stands"):
        facts.append(("Robot", f"stands, within {100.0 * result['robot_pelvis_offset_m']:.1f} cm"))
    elif "robot_stands" in result:
        facts.append(("Robot", result.get("robot_failure") or "does not stand"))
    return facts
