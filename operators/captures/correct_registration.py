"""Correct the world's ground, scale or frame by what a person showed."""

import json

import bpy
import numpy as np
from bpy.props import EnumProperty

from ...r2sego_blender.bridge.captures.registration_frame import remove_frame, world_from_frame
from ...r2sego_blender.bridge.captures.show_captures import CAPTURES_PART, show_captures, shows_points
from ...r2sego_blender.bridge.shared.outliner import find_collection
from ...r2sego_blender.captures.frame.picks_fit import residual_lines
from ...r2sego_blender.core.errors import CaptureError
from ...r2sego_blender.results.panels.picks import picks_of
from .. import state
from ..base import EngineOperator, needs_bundle, needs_idle_engine
from ..engine_files import hand_over


def show_corrected(context, residuals):
    """Read the bundle again, show its captures where they are now, and what the correction left."""
    scene = context.scene
    state.refresh(scene)
    bundle = state.opened_bundle(context)
    shown = scene.r2sego_captures
    if find_collection(scene, bundle.path, CAPTURES_PART) is not None:
        show_captures(
            scene,
            bundle,
            photographs=shown.show_photographs,
            points=shows_points(scene, bundle.path),
            photograph_alpha=shown.photograph_opacity,
        )
    remove_frame(scene, bundle.path)
    shown.residuals.clear()
    for line in residual_lines(residuals):
        shown.residuals.add().text = line


class R2SEGO_OT_correct_registration(EngineOperator, bpy.types.Operator):
    """Correct the world's ground, scale or frame"""

    bl_idname = "r2sego.correct_registration"
    bl_label = "Correct Registration"
    bl_description = (
        "Move the whole scene so that the picks, or the placed frame, are right; "
        "the next Refine redoes what depends on it"
    )
    bl_options = {"REGISTER"}

    by: EnumProperty(
        name="By",
        description="What says where the world shall be",
        items=[
            ("PICKS", "Picks", "Picked floor points, known lengths and the camera's height"),
            ("FRAME", "Frame", "The arrows of Place Frame"),
        ],
    )

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context) and needs_idle_engine(cls)

    def arguments(self, context):
        bundle = state.opened_bundle(context)
        command = ["register", str(bundle.path), "--json-progress"]
        if self.by == "FRAME":
            context.view_layer.update()
            pose = world_from_frame(context.scene, bundle)
            return [*command, "--frame", ",".join(f"{number:.9g}" for number in np.ravel(pose[:3]))]
        shown = context.scene.r2sego_captures
        picks = picks_of(shown)
        picks.check()
        if not (picks.heights or picks.lengths or any(point.floor for point in picks.points)):
            raise CaptureError(
                "nothing tells the floor or the scale yet",
                cure="Pick points of the floor, or add a length between two points, or a camera's height.",
            )
        file = hand_over("picks.json", json.dumps(picks.to_json()))
        return [*command, "--picks", str(file)]

    def finish(self, context, result):
        show_corrected(context, result.get("residuals") or {})
        return f"Corrected: {result.get('ground', '')}; {result.get('scale', '')}"
