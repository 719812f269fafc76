"""What Blender remembers of the proxy: its colours, the objects, the edits, what Refine would redo."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)

from ...r2sego_blender.bridge.proxy import placement_live
from ...r2sego_blender.bridge.proxy.object_masks import masked_objects
from ...r2sego_blender.bridge.proxy.show_proxy import colour_proxy, is_current, shown_proxy
from ...r2sego_blender.geometry.proxy.edits import PROXY_EDITS
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.proxy_colours import COLOURINGS
from ...r2sego_blender.results.panels.proxy_coverage import read_coverage
from ...r2sego_blender.results.panels.proxy_objects import read_objects
from .. import state

_KINDS = {"cut": "cut away", "draw": "drawn"}


class R2SEGO_PG_proxy_colour(bpy.types.PropertyGroup):
    """A line of the legend."""

    colour: FloatVectorProperty(size=3, subtype="COLOR_GAMMA", min=0.0, max=1.0)
    area: FloatProperty(unit="AREA")


class R2SEGO_PG_proxy_object(bpy.types.PropertyGroup):
    """An object: its masks, and what became of its shape prior."""

    state: StringProperty()
    why: StringProperty()
    masks: IntProperty()
    shape: StringProperty()
    iou: FloatProperty(default=-1.0)
    energy: FloatProperty(default=-1.0)
    residual: FloatProperty(default=-1.0, unit="LENGTH")
    has_prior: BoolProperty()
    own_mesh: BoolProperty()
    placed: BoolProperty()
    declared: BoolProperty()


class R2SEGO_PG_removed_object(bpy.types.PropertyGroup):
    """An object that the bundle has until Declare takes it from there."""


class R2SEGO_PG_proxy_edit(bpy.types.PropertyGroup):
    """An edit of the proxy that the bundle keeps."""

    kind: StringProperty()
    faces: IntProperty()
    area: FloatProperty(unit="AREA")


def _recolour(group: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    colour_shown(group.id_data)


class R2SEGO_PG_proxy(bpy.types.PropertyGroup):
    """The room Geometry Proxy."""

    colour_by: EnumProperty(
        name="Colour By", description="What the colours of the shown proxy mean", update=_recolour,
        items=[(name, kind.name, kind.description) for name, kind in COLOURINGS.items()],
    )  # fmt: skip
    legend: CollectionProperty(type=R2SEGO_PG_proxy_colour)
    legend_note: StringProperty()
    older: BoolProperty()
    """Whether the shown proxy was redone since."""
    has_coverage: BoolProperty()
    objects: CollectionProperty(type=R2SEGO_PG_proxy_object)
    removed: CollectionProperty(type=R2SEGO_PG_removed_object)
    declared_count: IntProperty()
    object_index: IntProperty(name="Object", description="The object that masks and priors are edited of")
    mask_tool: EnumProperty(
        name="Tool", description="How a mask is drawn in a capture's camera view",
        items=[
            ("LASSO", "Lasso", "Drag around the object"),
            ("POLYGON", "Polygon", "Click corner by corner; Enter or a double click closes"),
            ("BRUSH", "Brush", "Paint along the mouse's way"),
        ],
    )  # fmt: skip
    brush_radius: IntProperty(
        name="Radius", description="Radius of the brush, in pixels of the photograph", default=12, min=1,
        max=500, subtype="PIXEL",
    )  # fmt: skip
    show_outlines: BoolProperty(
        name="Outlines", default=True,
        description="Draw the outlines of masks and of the shown prior in the captures' camera views",
    )  # fmt: skip
    fit_object: StringProperty()
    fit_iou: FloatProperty(default=-1.0)
    fit_residual: FloatProperty(default=-1.0, unit="LENGTH")
    fit_views: StringProperty()
    edits: CollectionProperty(type=R2SEGO_PG_proxy_edit)
    edit_index: IntProperty(name="Edit", description="The edit that Remove takes back")
    farthest: FloatProperty(
        name="Farthest", description="The lasso takes no face farther from the view than this",
        subtype="DISTANCE", unit="LENGTH", min=0.0, default=20.0,
    )  # fmt: skip
    plan: StringProperty()


def colour_shown(scene: bpy.types.Scene) -> None:
    """Colour the shown proxy as chosen, and write the legend; nothing where none is shown."""
    group = scene.r2sego_proxy
    group.legend.clear()
    group.legend_note = ""
    shown = shown_proxy(scene, state.bundle_path(scene))
    if shown is None:
        return
    if shown.mode == "EDIT":
        group.legend_note = "Leave Edit Mode to change colours"
        return
    found = colour_proxy(shown, group.colour_by)
    if found is None:
        group.legend_note = "Measure Coverage first"
        return
    colouring, areas = found
    for label, colour, area in zip(colouring.labels, colouring.colours, areas, strict=True):
        line = group.legend.add()
        line.name, line.colour, line.area = label, colour, float(area)


def forget_bundle(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """Forget another bundle's objects; those whose masks were drawn for this one are back."""
    group = scene.r2sego_proxy
    placement_live.forget()
    group.objects.clear()
    group.removed.clear()
    group.legend.clear()
    fit = ("fit_object", "fit_iou", "fit_residual", "fit_views")
    for name in ("object_index", "edit_index", "legend_note", *fit):
        group.property_unset(name)
    for name in masked_objects(bundle.path):
        add_object(group, name)


def read_bundle(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """The listener: take over what the bundle knows of coverage, objects and edits."""
    group = scene.r2sego_proxy
    group.has_coverage = read_coverage(bundle, scene.r2sego.round_index) is not None
    group.plan = ""
    note_age(scene, bundle)
    if not group.legend and not group.legend_note and state.may_show():
        colour_shown(scene)  # of a bundle that is open again
    _read_edits(group, bundle)
    _read_objects(group, bundle)


def note_age(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """Note whether the shown proxy is older than its file; where none is shown, there is no legend."""
    group, shown = scene.r2sego_proxy, shown_proxy(scene, bundle.path)
    group.older = shown is not None and not is_current(shown, bundle)
    if shown is None:
        group.legend.clear()
        group.legend_note = ""


def _read_edits(group: bpy.types.PropertyGroup, bundle: Bundle) -> None:
    group.edits.clear()
    for edit in bundle.scene.read(PROXY_EDITS):
        item = group.edits.add()
        item.name, item.kind = edit.name, _KINDS[edit.change.kind]
        item.faces, item.area = edit.count, edit.change.area_m2
    group.edit_index = min(group.edit_index, max(0, len(group.edits) - 1))


def _read_objects(group: bpy.types.PropertyGroup, bundle: Bundle) -> None:
    """The bundle's objects but the removed ones, then those that are only drawn in Blender so far."""
    drawn = [item.name for item in group.objects if not item.declared]
    chosen = active_object(group)
    group.objects.clear()
    declared = read_objects(bundle)
    group.declared_count = len(declared)
    for known in declared:
        if known.name in group.removed:
            continue
        item = group.objects.add()
        item.name, item.state, item.why, item.shape = known.name, known.state, known.why, known.shape
        item.masks, item.declared = known.masks, True
        item.has_prior, item.own_mesh, item.placed = known.has_prior, known.own_mesh, known.placed
        item.iou, item.energy, item.residual = known.iou, known.energy, known.residual_m
    for name in drawn:
        if name not in group.objects:
            add_object(group, name)
    index = group.objects.find(chosen)
    group.object_index = index if index >= 0 else min(group.object_index, max(0, len(group.objects) - 1))


def add_object(group: bpy.types.PropertyGroup, name: str) -> None:
    """An object that only Blender knows so far."""
    item = group.objects.add()
    item.name, item.state = name, "drawn"


def active_object(group: bpy.types.PropertyGroup) -> str:
    """The name of the chosen object, '' when there is none."""
    inside = 0 <= group.object_index < len(group.objects)
    return group.objects[group.object_index].name if inside else ""


CLASSES = (
    R2SEGO_PG_proxy_colour,
    R2SEGO_PG_proxy_object,
    R2SEGO_PG_removed_object,
    R2SEGO_PG_proxy_edit,
    R2SEGO_PG_proxy,
)
