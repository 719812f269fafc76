"""Play a generated clip through the camera that goes along its path."""

from functools import partial

import bpy
from bpy.props import BoolProperty

from ...r2sego_blender.bridge.generation.show_path import show_path
from ...r2sego_blender.bridge.shared.cameras import use_frame_of
from ...r2sego_blender.bridge.shared.clip_images import clip_image, play_in_editor, put_behind
from ...r2sego_blender.bridge.shared.image_editors import show_image
from ...r2sego_blender.bridge.shared.views_3d import look_through
from ...r2sego_blender.core.errors import GenerationError
from ...r2sego_blender.results.panels.view_parts import clip_files
from ..base import ReportingOperator
from .views import OfOneView

_FIRST_FRAME = 1


class R2SEGO_OT_play_clip(OfOneView, ReportingOperator, bpy.types.Operator):
    """Play the generated clip over what the scene shows, through the camera along its path"""

    bl_idname = "r2sego.play_clip"
    bl_label = "Play Clip"
    bl_options = {"REGISTER", "UNDO"}

    in_editor: BoolProperty(
        name="In an Image Editor", description="Show the clip in an Image Editor too, a new window if needed"
    )

    def perform(self, context):
        bundle, shown, record = self.chosen(context)
        files = clip_files(record.folder)
        if not files:
            raise GenerationError(
                "no clip was generated for this view", where=record.folder, cure="Choose another view."
            )
        path = bundle.camera_path(shown, record.rank)
        scene, name = context.scene, f"View {record.rank:03d}"
        _, camera = show_path(scene, bundle.path, name, path, _FIRST_FRAME)
        image = clip_image("R2S-EGO Clip", files)
        put_behind(camera, image, len(files), _FIRST_FRAME)
        use_frame_of(camera, scene)
        scene.frame_set(_FIRST_FRAME)
        if self.in_editor:
            show_image(image, partial(play_in_editor, frames=len(files), first_frame=_FIRST_FRAME))
        if context.area is not None and context.area.type == "VIEW_3D":
            look_through(context.area, camera)
        if not bpy.app.background and context.screen is not None and not context.screen.is_animation_playing:
            bpy.ops.screen.animation_play()
        return f"{name}: {len(files)} frames"
