"""Masks of objects on the photographs: objects named, masks drawn, painted, loaded and declared."""

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, StringProperty

from ...r2sego_blender.bridge.asset.asset_frame import camera_frame_px
from ...r2sego_blender.bridge.captures.show_captures import looked_through
from ...r2sego_blender.bridge.proxy.object_masks import (
    drawn_region,
    forget_masks,
    load_masks,
    mask_image,
    mask_images,
    mask_in,
    read_mask,
    save_masks,
    write_mask,
)
from ...r2sego_blender.bridge.shared.image_editors import image_editors
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.core.errors import GeometryError
from ...r2sego_blender.core.file_names import plain_name
from ...r2sego_blender.core.formatting import counted
from ...r2sego_blender.results.panels.proxy_objects import read_objects
from .. import state
from ..base import EngineOperator, ReportingOperator, needs_bundle, needs_idle_engine
from ..drawing import Drawing
from ..engine_files import handed_over
from .place_prior import rate_again
from .polls import needs_object, object_named
from .properties import drawn_entry


def captured_view(context, capture: str):
    """The capture of this name, by default the one that is looked through. Raises GeometryError: none."""
    bundle = state.opened_bundle(context)
    name = capture or looked_through(context.scene, bundle.path)
    found = next((view for view in bundle.captures() if view.name == name), None)
    if found is None:
        raise GeometryError(
            f"there is no capture '{name}'" if name else "no capture is looked through",
            cure="Import the captures, and look through one.",
        )
    return found


def _masks_to_edit(context, name: str, view) -> dict[str, bpy.types.Image]:
    """An object's masks by capture, one of ``view`` among them; with those of the bundle, which Declare
    would otherwise replace by the edited one alone."""
    bundle = state.opened_bundle(context)
    if context.scene.r2sego_proxy.objects[name].declared:
        load_masks(bundle, name, anew=False)
    mask_image(bundle.path, name, view)
    return mask_images(bundle.path, name)


class R2SEGO_OT_new_object(ReportingOperator, bpy.types.Operator):
    """Name an object, to draw its masks on the photographs"""

    bl_idname = "r2sego.new_object"
    bl_label = "New Object"
    bl_options = {"REGISTER", "UNDO"}

    name: StringProperty(name="Name", description="What the object is called, such as chair", default="object")

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context)

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self)

    def perform(self, context):
        group, name = context.scene.r2sego_proxy, plain_name(self.name)
        if name.lower() in {item.name.lower() for item in group.objects}:
            raise GeometryError(f"there is an object '{name}' already", cure="Choose another name.")
        drawn_entry(group, name)
        group.object_index = group.objects.find(name)
        return f"Draw the mask of '{name}' in two captures at least"


class R2SEGO_OT_remove_object(ReportingOperator, bpy.types.Operator):
    """Forget an object and its masks in Blender; Declare takes it from the bundle too"""

    bl_idname = "r2sego.remove_object"
    bl_label = "Remove Object"
    bl_options = {"REGISTER", "UNDO"}

    name: StringProperty(name="Object", description="The object; empty = the chosen one", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return needs_object(cls, context)

    def perform(self, context):
        group, name = context.scene.r2sego_proxy, object_named(context, self.name)
        declared, place = group.objects[name].declared, group.object_index
        forget_masks(state.bundle_path(context.scene), name)
        if name in group.drawn:
            group.drawn.remove(group.drawn.find(name))
        if declared:
            group.removed.add().name = name
        group.object_index = min(place, max(0, len(group.objects) - 1))
        redraw_views("WINDOW")
        return f"Forgot '{name}'; Declare takes it from the bundle too" if declared else f"Forgot '{name}'"


class R2SEGO_OT_draw_mask(Drawing, ReportingOperator, bpy.types.Operator):
    """Draw the chosen object's mask in the capture that is looked through; Ctrl takes away"""

    bl_idname = "r2sego.draw_mask"
    bl_label = "Draw Mask"
    bl_options = {"REGISTER", "UNDO"}

    object_name: StringProperty(name="Object", description="The object; empty = the chosen one", options={"SKIP_SAVE"})
    capture: StringProperty(
        name="Capture", description="The capture; empty = the one looked through", options={"SKIP_SAVE"}
    )
    points: StringProperty(
        name="Points",
        options={"SKIP_SAVE"},
        description="Pixels of the photograph from its top left corner, such as 10,20 30,20 30,40",
    )
    tool: EnumProperty(
        name="Tool",
        description="What the points mean",
        items=[
            ("LASSO", "Lasso", "The points go around the object"),
            ("POLYGON", "Polygon", "The points are the corners around the object"),
            ("BRUSH", "Brush", "The points are the brush's way"),
        ],
    )
    radius: FloatProperty(
        name="Radius",
        description="Radius of the brush, in pixels of the photograph",
        default=12.0,
        min=0.5,
        subtype="PIXEL",
    )
    subtract: BoolProperty(name="Subtract", description="Take away from the mask", options={"SKIP_SAVE"})

    hint = "Mask: drag, or click corners and press Enter (ESC cancels)"

    @classmethod
    def poll(cls, context):
        return needs_object(cls, context)

    def perform(self, context):
        name, view = object_named(context, self.object_name), captured_view(context, self.capture)
        points = _pixels(self.points)
        if len(points) < (1 if self.tool == "BRUSH" else 3):
            raise GeometryError("too few points", cure="Draw around the object.")
        region = drawn_region(view.camera.shape, points, self.tool, self.radius)
        images = _masks_to_edit(context, name, view)
        image = images[view.name]
        mask = mask_in(image, view)
        write_mask(image, mask & ~region if self.subtract else mask | region)
        item = drawn_entry(context.scene.r2sego_proxy, name)
        item.masks = sum(bool(read_mask(one).any()) for one in images.values())
        rate_again(context, name)
        redraw_views("WINDOW")
        return f"{name} in {view.name}: {int(read_mask(image).sum())} pixels"

    def begin(self, context):
        group = context.scene.r2sego_proxy
        self.tool, self.radius, self.points = group.mask_tool, float(group.brush_radius), ""
        self.clicks = self.tool == "POLYGON"
        self._view = captured_view(context, self.capture)
        if self._frame(context) is None:
            raise GeometryError("no capture is looked through", cure="Press Look Through first.")

    def end(self, context, points):
        frame = self._frame(context)
        if frame is None:
            raise GeometryError("no capture is looked through now", cure="Press Look Through, then draw.")
        left, bottom, width, height = frame
        size = np.array([self._view.camera.width, self._view.camera.height])
        shares = (np.array(points, np.float64) - (left, bottom)) / (width, height)
        shares[:, 1] = 1.0 - shares[:, 1]
        self.points = " ".join(f"{x:.2f},{y:.2f}" for x, y in shares * size)

    def on_event(self, context, event):
        if event.type == "LEFTMOUSE" and event.value == "PRESS" and not self._points:
            self.subtract = event.ctrl
        return super().on_event(context, event)

    def _frame(self, context):
        return camera_frame_px(context)


def _pixels(text: str) -> np.ndarray:
    try:
        points = np.array([pair.split(",") for pair in text.split()], np.float64).reshape(-1, 2)
        if not np.isfinite(points).all():
            raise ValueError("a number is none")
        return points
    except ValueError as error:
        raise GeometryError(f"'{text}' are no points", cure="Give them as x,y x,y x,y.") from error


class R2SEGO_OT_paint_mask(ReportingOperator, bpy.types.Operator):
    """Open the chosen object's mask of this capture in the Image Editor, to paint on it in white and black"""

    bl_idname = "r2sego.paint_mask"
    bl_label = "Paint Mask"
    bl_options = {"REGISTER", "UNDO"}

    object_name: StringProperty(name="Object", description="The object; empty = the chosen one", options={"SKIP_SAVE"})
    capture: StringProperty(
        name="Capture", description="The capture; empty = the one looked through", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context):
        return needs_object(cls, context)

    def perform(self, context):
        name, view = object_named(context, self.object_name), captured_view(context, self.capture)
        image = _masks_to_edit(context, name, view)[view.name]
        editors = [area for _, area in image_editors()]
        for area in editors:
            area.spaces.active.image = image
            area.spaces.active.mode = "PAINT"
        where = "in the Image Editor" if editors else "open an Image Editor to paint on it"
        return f"{image.name}: {where}"


class R2SEGO_OT_load_masks(ReportingOperator, bpy.types.Operator):
    """Take the masks that the bundle has into Blender, in place of those drawn here"""

    bl_idname = "r2sego.load_masks"
    bl_label = "Load Masks"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context)

    def perform(self, context):
        bundle, group = state.opened_bundle(context), context.scene.r2sego_proxy
        count = 0
        for item in group.objects:
            if item.declared:
                count += load_masks(bundle, item.name)
                if item.name in group.drawn:
                    group.drawn[item.name].masks = -1
        redraw_views("WINDOW")
        return f"Loaded {counted(count, 'mask')}"


class R2SEGO_OT_declare_masks(EngineOperator, bpy.types.Operator):
    """Give the masks drawn here to the bundle as its objects; the next Refine looks for their priors"""

    bl_idname = "r2sego.declare_masks"
    bl_label = "Declare Masks"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        if not context.scene.r2sego_proxy.declared and not needs_object(cls, context):
            return False
        return needs_bundle(cls, context) and needs_idle_engine(cls)

    def arguments(self, context):
        bundle, group = state.opened_bundle(context), context.scene.r2sego_proxy
        if not group.objects:  # all are removed
            gone = [f"--remove={one.name}" for one in read_objects(bundle)]
            return ["objects", str(bundle.path), "--json", *gone]
        names = [item.name for item in group.objects]
        declared = [item.name for item in group.objects if item.declared]
        folder = handed_over("masks")
        if not save_masks(bundle, folder, names, declared):  # what was not looked at here stays as it is
            raise GeometryError(
                "no mask is drawn", cure="Draw an object in two captures at least, or remove the objects."
            )
        return ["objects", str(bundle.path), "--masks", str(folder), "--json"]

    def finish(self, context, result):
        group = context.scene.r2sego_proxy
        group.drawn.clear()  # those that the bundle did not take are gone with this
        group.removed.clear()
        state.refresh(context.scene)
        if not group.objects:
            return "No object is declared any more: the next Refine places no priors"
        return f"{counted(len(group.objects), 'object')} declared: the next Refine looks for their priors"
