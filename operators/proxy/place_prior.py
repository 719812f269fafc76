"""Shape priors shown, placed by hand with their fit followed live, and the placement kept."""

import json
import math

import bpy
from bpy.props import BoolProperty, StringProperty

from ...r2sego_blender.bridge.proxy import placement_live
from ...r2sego_blender.bridge.proxy.object_masks import load_masks, take_pixels_back
from ...r2sego_blender.bridge.proxy.placement_objects import (
    prior_name,
    prior_object,
    show_priors,
    write_mesh,
    write_placement,
)
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.core.errors import GeometryError, R2SEgoError
from ...r2sego_blender.core.formatting import counted
from .. import state
from ..base import (
    EngineOperator,
    ReportingOperator,
    description_of_choice,
    needs_bundle,
    needs_idle_engine,
    require_visible,
    select_only,
)
from ..engine_files import hand_over, handed_over
from .polls import declared_object, needs_object


def shown_prior(context, name: str):
    """The shown prior of an object, by default of the chosen one. Raises GeometryError: none."""
    bundle, found = state.opened_bundle(context), declared_object(context, name)
    shown = prior_object(context.scene, bundle.path, found)
    if shown is None and not context.scene.r2sego_proxy.objects[found].has_prior:
        raise GeometryError(f"'{found}' has no prior yet", cure="Run Refine: it makes one, or says why not.")
    if shown is None:
        raise GeometryError(f"the prior of '{found}' is not shown", cure="Press Show Priors first.")
    return shown


def tell_fit(scene: bpy.types.Scene, shown: bpy.types.Object) -> None:
    """Write the followed prior's figures where the panel shows them."""
    fit, residual_m = placement_live.rated(shown)
    group = scene.r2sego_proxy
    group.fit_object, group.fit_iou = prior_name(shown), fit.iou
    group.fit_residual = -1.0 if math.isnan(residual_m) else residual_m
    names = placement_live.windows(shown)
    group.fit_views = ", ".join(f"{name}\u00a0{iou:.2f}" for name, iou in zip(names, fit.ious, strict=True))


def rate_again(context, name: str) -> None:
    """Follow the prior of this object anew, if it is the one that is followed: its masks have changed."""
    group = context.scene.r2sego_proxy
    if group.fit_object != name:
        return
    bundle = state.opened_bundle(context)
    shown = prior_object(context.scene, bundle.path, name)
    if shown is not None and placement_live.followed(shown):
        placement_live.begin(bundle, shown)
        tell_fit(context.scene, shown)


@bpy.app.handlers.persistent
def follow(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Rate the scene's placed prior again when it was moved."""
    name = scene.r2sego_proxy.fit_object
    if not name:
        return
    for update in depsgraph.updates:
        if update.is_updated_transform and isinstance(update.id, bpy.types.Object):
            shown = update.id.original
            if prior_name(shown) != name:
                continue
            if placement_live.followed(shown) or follow_again(scene) == shown:
                tell_fit(scene, shown)
                redraw_views()
                return


def follow_again(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Follow the prior that is placed in a scene, where undo, another file or another scene had it
    forgotten; None where it is followed already, or there is nothing to follow."""
    name = scene.r2sego_proxy.fit_object
    try:
        bundle = state.bundle_of(scene) if name else None
        shown = prior_object(scene, bundle.path, name) if bundle is not None else None
        if shown is None or placement_live.compares_with(bundle.path, shown):
            return None
        placement_live.begin(bundle, shown)
    except (R2SEgoError, OSError):  # no masks or no bundle any more
        placement_live.forget()
        return None
    return shown


@bpy.app.handlers.persistent
def undone(scene: bpy.types.Scene, *_: object) -> None:
    """Show the masks that undo or redo brought back, and follow what it says is placed by them."""
    take_pixels_back()
    placement_live.forget_outlines()
    shown = follow_again(scene)
    if shown is not None:
        bpy.context.view_layer.update()  # so that it stands where undo put it
        tell_fit(scene, shown)


@bpy.app.handlers.persistent
def forget(_file: str) -> None:
    """Another file has other objects."""
    placement_live.forget()


@bpy.app.handlers.persistent
def opened(_file: str) -> None:
    """Another file may have a prior that is being placed."""
    follow_again(bpy.context.scene)


class R2SEGO_OT_show_priors(ReportingOperator, bpy.types.Operator):
    """Show the shape priors of the last run as objects: teal, or red where they were refused"""

    bl_idname = "r2sego.show_priors"
    bl_label = "Show Priors"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context)

    def perform(self, context):
        placement_live.forget()
        context.scene.r2sego_proxy.fit_object = ""
        shown = show_priors(context.scene, state.opened_bundle(context))
        return counted(len(shown), "prior")


class R2SEGO_OT_place_prior(ReportingOperator, bpy.types.Operator):
    """Select the chosen object's prior and follow its fit: move, turn or scale it against the masks"""

    bl_idname = "r2sego.place_prior"
    bl_label = "Place Prior"
    bl_options = {"REGISTER", "UNDO"}

    object_name: StringProperty(name="Object", description="The object; empty = the chosen one", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return needs_object(cls, context)

    def perform(self, context):
        shown = shown_prior(context, self.object_name)
        require_visible(context, shown)
        bundle = state.opened_bundle(context)
        load_masks(bundle, prior_name(shown), anew=False)  # their outlines are drawn
        placement_live.begin(bundle, shown)
        tell_fit(context.scene, shown)
        select_only(context, shown)
        redraw_views()
        return f"{prior_name(shown)}: overlap {context.scene.r2sego_proxy.fit_iou:.2f}"


class R2SEGO_OT_save_placement(EngineOperator, bpy.types.Operator):
    """Keep the chosen object's prior where it stands now; the next Refine begins there, or leaves it so"""

    bl_idname = "r2sego.save_placement"
    bl_label = "Save Placement"
    bl_options = {"REGISTER"}

    object_name: StringProperty(name="Object", description="The object; empty = the chosen one", options={"SKIP_SAVE"})
    locked: BoolProperty(
        name="Lock",
        default=True,
        description="Keep it exactly there; else the alignment begins there",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        return needs_object(cls, context) and needs_idle_engine(cls)

    def arguments(self, context):
        name, shown = declared_object(context, self.object_name), shown_prior(context, self.object_name)
        known = context.scene.r2sego_proxy.objects[name]
        if not (known.own_mesh or known.shape):
            raise GeometryError(f"'{name}' has no mesh to place", cure="Give it one with Use Active Mesh.")
        require_visible(context, shown)  # Blender does not follow where an excluded object is moved
        file = handed_over("placement.json")
        write_placement(file, shown, locked=self.locked)
        return ["objects", str(state.opened_bundle(context).path), "--json", "--place", f"{name}={file}"]

    def finish(self, context, result):
        state.refresh(context.scene)
        return "Placement kept: the next Refine redoes what depends on it"


class R2SEGO_OT_use_mesh_as_prior(EngineOperator, bpy.types.Operator):
    """Take the active mesh object as the chosen object's shape"""

    bl_idname = "r2sego.use_mesh_as_prior"
    bl_label = "Use Active Mesh"
    bl_options = {"REGISTER"}

    object_name: StringProperty(name="Object", description="The object; empty = the chosen one", options={"SKIP_SAVE"})
    mesh: StringProperty(name="Mesh", description="The mesh object; empty = the active one", options={"SKIP_SAVE"})
    place: bpy.props.EnumProperty(
        name="Pose",
        description="Where the shape goes",
        items=[
            ("SEARCH", "Search", "The next Refine looks for the pose that fits"),
            ("START", "Begin Here", "The search begins where the mesh stands"),
            ("LOCK", "Keep Here", "The mesh stays exactly where it stands"),
        ],
    )

    @classmethod
    def poll(cls, context):
        return needs_object(cls, context) and needs_idle_engine(cls)

    def arguments(self, context):
        name = declared_object(context, self.object_name)
        mesh = bpy.data.objects.get(self.mesh) if self.mesh else context.view_layer.objects.active
        if mesh is None or mesh.type != "MESH":
            raise GeometryError("no mesh object is chosen", cure="Select the mesh to use.")
        file = handed_over("mesh.obj")
        write_mesh(file, mesh, context.evaluated_depsgraph_get())
        command = ["objects", str(state.opened_bundle(context).path), "--json", "--mesh", f"{name}={file}"]
        if self.place == "SEARCH":
            return command
        # The file is in the world already.
        pose = [[float(row == column) for column in range(4)] for row in range(4)]
        placement = hand_over("placement.json", json.dumps({"world_from_own": pose, "locked": self.place == "LOCK"}))
        return [*command, "--place", f"{name}={placement}"]

    def finish(self, context, result):
        state.refresh(context.scene)
        return "Mesh taken: the next Refine uses it"


class R2SEGO_OT_decide_prior(EngineOperator, bpy.types.Operator):
    """Accept, reject, lock or let go of the chosen object's prior"""

    bl_idname = "r2sego.decide_prior"
    bl_label = "Decide on Prior"
    bl_options = {"REGISTER"}

    object_name: StringProperty(name="Object", description="The object; empty = the chosen one", options={"SKIP_SAVE"})
    decision: bpy.props.EnumProperty(
        name="Decision",
        description="What becomes of the prior in the next Refine",
        items=[
            ("accept", "Accept", "Take the prior whatever its figures"),
            ("reject", "Reject", "Take no prior for this object"),
            ("reconsider", "By Its Figures", "Let the figures decide again"),
            ("lock", "Lock", "Hold the last alignment as it is"),
            ("unlock", "Unlock", "Align it again"),
        ],
    )

    @classmethod
    def poll(cls, context):
        return needs_object(cls, context) and needs_idle_engine(cls)

    @classmethod
    def description(cls, context, properties):
        return description_of_choice(properties, "decision")

    def arguments(self, context):
        name = declared_object(context, self.object_name)
        return ["objects", str(state.opened_bundle(context).path), "--json", f"--{self.decision}", name]

    def finish(self, context, result):
        state.refresh(context.scene)
        return "Decided: the next Refine redoes what depends on it"
