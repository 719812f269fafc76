"""Render the asset exactly, from the active camera, by the engine."""

import json
from pathlib import Path

import bpy
from bpy.props import EnumProperty, FloatVectorProperty, StringProperty

from ...r2sego_blender.bridge.asset.asset_cameras import exact_camera
from ...r2sego_blender.bridge.asset.asset_pictures import load_picture, note_pose, pose_values, put_behind
from ...r2sego_blender.bridge.shared.image_editors import show_in_editor
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.bundle.asset_stages import PASSES, stage_label, stage_named
from ...r2sego_blender.core.errors import SceneError
from ...r2sego_blender.results.panels.asset_renderings import camera_folder, prune, remove_rendering
from .. import state
from ..base import EngineOperator, needs_idle_engine
from ..engine_files import hand_over
from .polls import needs_asset

_PLACES = (
    ("BACKGROUND", "Camera Background", "Look through the camera at the picture"),
    ("LEFT", "Left of the Wipe", "Compare it in the camera's frame, on the left"),
    ("RIGHT", "Right of the Wipe", "Compare it in the camera's frame, on the right"),
    ("EDITOR", "Image Editor", "Show it in the first image editor on the screen"),
    ("NONE", "Nowhere", "Only load it as an image"),
)


class R2SEGO_OT_render_asset(EngineOperator, bpy.types.Operator):
    """Render the asset exactly from the active camera, as the evaluation does"""

    bl_idname = "r2sego.render_asset"
    bl_label = "Render Asset"
    bl_options = {"REGISTER"}

    camera: StringProperty(
        name="Camera", description="The camera object; empty = the active one, else the scene's", options={"SKIP_SAVE"}
    )
    stage: StringProperty(
        name="Asset",
        description="initial, a round's number, or final; empty = where the slider stands",
        options={"SKIP_SAVE"},
    )
    render_pass: EnumProperty(
        name="Pass",
        description="What is rendered",
        items=[(name, name.capitalize(), f"The {name} of each pixel") for name in PASSES],
    )
    place: EnumProperty(name="Show", description="Where the picture is shown", items=_PLACES)
    seen_from: FloatVectorProperty(size=16, options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        if not (needs_asset(cls, context) and needs_idle_engine(cls)):
            return False
        if not bpy.data.cameras:
            cls.poll_message_set("There is no camera: press Import under Captures, or add one")
            return False
        return True

    def arguments(self, context):
        bundle, group = state.opened_bundle(context), context.scene.r2sego_asset
        seen_from = _camera_object(context, self.camera)
        if seen_from is None:
            raise SceneError(
                f"there is no camera '{self.camera}'" if self.camera else "no camera is chosen",
                cure="Select a camera, or make one the scene's active camera.",
            )
        context.view_layer.update()
        camera = {"name": "picture", **exact_camera(seen_from, context.scene).to_json()}
        stage = stage_named(bundle.scene, self.stage or group.stages[group.stage].name)
        # The job's end finds by these what it began with, whatever is chosen then.
        self.camera, self.stage, self.seen_from = seen_from.name, stage.name, pose_values(seen_from)
        cameras = hand_over("cameras.json", json.dumps({"cameras": [camera]}))
        folder = camera_folder(bundle, stage, camera)
        return [
            "render",
            str(bundle.path),
            "--cameras",
            str(cameras),
            "--to",
            str(folder),
            "--round",
            stage.name,
            "--pass",
            self.render_pass,
            "--json-progress",
        ]

    def finish(self, context, result):
        if not result.get("files"):
            raise SceneError("the engine made no picture", cure="Render again.")
        name = f"{self.camera}, {stage_label(self.stage).lower()}"
        name += "" if self.render_pass == "colour" else f", {self.render_pass}"
        file, bundle = Path(result["files"][0]), state.opened_bundle(context)
        image = load_picture(file, name)
        note_pose(image, self.seen_from)
        remove_rendering(bundle, file)  # the image holds it
        prune(bundle)
        group, seen_from = context.scene.r2sego_asset, bpy.data.objects.get(self.camera)
        if self.place == "BACKGROUND" and seen_from is not None:
            put_behind(seen_from, image)
        elif self.place == "LEFT":
            group.wipe_left, group.compare = image, True
        elif self.place == "RIGHT":
            group.wipe_right, group.compare = image, True
        elif self.place == "EDITOR" and not show_in_editor(image):
            return f"Rendered {image.name}: open an Image Editor to see it"
        redraw_views()
        return f"Rendered {image.name}: {image.size[0]} x {image.size[1]}"


def _camera_object(context, name: str) -> bpy.types.Object | None:
    """The camera of a name, else the active one, else the scene's."""
    if name:
        found = bpy.data.objects.get(name)
        return found if found is not None and found.type == "CAMERA" else None
    active = context.view_layer.objects.active
    return active if active is not None and active.type == "CAMERA" else context.scene.camera
