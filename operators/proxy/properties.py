"""What a person chose of the proxy: its colours, the objects drawn and removed, how masks are drawn."""

from dataclasses import replace

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ...r2sego_blender.bridge.proxy import placement_live
from ...r2sego_blender.bridge.proxy.object_masks import masked_objects
from ...r2sego_blender.bridge.proxy.show_proxy import (
    LegendLine,
    colour_proxy,
    legend_of,
    shown_proxy,
    shows_older_proxy,
)
from ...r2sego_blender.bridge.shared.panel_facts import Fact, Facts, facts_of, make_rows
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.proxy_colours import COLOURINGS
from ...r2sego_blender.results.panels.proxy_objects import KnownObject
from .. import state
from .facts import ProxyFacts


class R2SEGO_PG_drawn_object(bpy.types.PropertyGroup):
    """An object whose masks were drawn in Blender, and in how many captures, -1 where nobody counted."""

    masks: IntProperty(default=-1)


class R2SEGO_PG_removed_object(bpy.types.PropertyGroup):
    """An object that the bundle has until Declare takes it from there."""


def _chosen_index(group: bpy.types.PropertyGroup) -> int:
    """The place of the chosen object; of the one that came to its place when it is gone."""
    objects = group.objects
    index = objects.find(group.chosen_object)
    return index if index >= 0 else min(group.chosen_place, max(0, len(objects) - 1))


def _choose_index(group: bpy.types.PropertyGroup, index: int) -> None:
    objects = group.objects
    group.chosen_place = index
    group.chosen_object = objects[index].name if 0 <= index < len(objects) else ""


def _recolour(group: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    colour_shown(group.id_data)


class R2SEGO_PG_proxy(bpy.types.PropertyGroup):
    """The room Geometry Proxy."""

    colour_by: EnumProperty(
        name="Colour By",
        description="What the colours of the shown proxy mean",
        update=_recolour,
        items=[(name, kind.name, kind.description) for name, kind in COLOURINGS.items()],
    )
    has_coverage, edits, plan = Fact(ProxyFacts), Fact(ProxyFacts), Fact(ProxyFacts)
    declared, library = Fact(ProxyFacts), Fact(ProxyFacts)
    drawn: CollectionProperty(type=R2SEGO_PG_drawn_object)
    removed: CollectionProperty(type=R2SEGO_PG_removed_object)
    chosen_object: StringProperty()
    chosen_place: IntProperty()
    object_index: IntProperty(
        name="Object",
        description="The object that masks and priors are edited of",
        get=_chosen_index,
        set=_choose_index,
    )
    mask_tool: EnumProperty(
        name="Tool",
        description="How a mask is drawn in a capture's camera view",
        items=[
            ("LASSO", "Lasso", "Drag around the object"),
            ("POLYGON", "Polygon", "Click corner by corner; Enter or a double click closes"),
            ("BRUSH", "Brush", "Paint along the mouse's way"),
        ],
    )
    brush_radius: IntProperty(
        name="Radius",
        description="Radius of the brush, in pixels of the photograph",
        default=12,
        min=1,
        max=500,
        subtype="PIXEL",
    )
    show_outlines: BoolProperty(
        name="Outlines",
        default=True,
        description="Draw the outlines of masks and of the shown prior in the captures' camera views",
    )
    fit_object: StringProperty()
    fit_iou: FloatProperty(default=-1.0)
    fit_residual: FloatProperty(default=-1.0, unit="LENGTH")
    fit_views: StringProperty()
    edit_index: IntProperty(name="Edit", description="The edit that Remove takes back")
    farthest: FloatProperty(
        name="Farthest",
        description="The lasso takes no face farther from the view than this",
        subtype="DISTANCE",
        unit="LENGTH",
        min=0.0,
        default=20.0,
    )

    @property
    def objects(self) -> Facts:
        """The bundle's objects but the removed ones, then those that are only drawn in Blender so far."""
        drawn = {one.name: one.masks for one in self.drawn}
        listed = []
        for known in self.declared:
            if known.name not in self.removed:
                masks = drawn.pop(known.name, -1)
                listed.append(replace(known, masks=masks) if masks >= 0 else known)
        others = (KnownObject(name, "drawn", max(0, masks), False) for name, masks in drawn.items())
        return Facts([*listed, *others])

    @property
    def older(self) -> bool:
        """Whether the shown proxy was redone since."""
        shown = self._shown()
        return shown is not None and shows_older_proxy(shown, facts_of(self.id_data, ProxyFacts).written)

    @property
    def legend(self) -> tuple[LegendLine, ...]:
        """What the colours of the shown proxy mean, none where they are others than the chosen ones."""
        shown = self._shown()
        by, lines = ("", ()) if shown is None else legend_of(shown)
        return lines if by == self.colour_by else ()

    @property
    def legend_note(self) -> str:
        """Why the shown proxy has not the chosen colours, '' where it has them."""
        shown = self._shown()
        if shown is None or legend_of(shown)[0] == self.colour_by:
            return ""
        if shown.mode == "EDIT":
            return "Leave Edit Mode to change colours"
        unknown = COLOURINGS[self.colour_by].needs_coverage and not self.has_coverage
        return "Measure Coverage first" if unknown else "Press Show to change colours"

    def _shown(self) -> bpy.types.Object | None:
        return shown_proxy(self.id_data, state.bundle_path(self.id_data))


def colour_shown(scene: bpy.types.Scene) -> None:
    """Colour the shown proxy as chosen, with its legend; not in Edit Mode."""
    shown = shown_proxy(scene, state.bundle_path(scene))
    if shown is not None and shown.mode != "EDIT":
        colour_proxy(shown, scene.r2sego_proxy.colour_by)


def forget_bundle(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """Forget another bundle's objects; those whose masks were drawn for this one are back."""
    group = scene.r2sego_proxy
    placement_live.forget()
    group.drawn.clear()
    group.removed.clear()
    fit = ("fit_object", "fit_iou", "fit_residual", "fit_views")
    for name in ("chosen_object", "chosen_place", "edit_index", *fit):
        group.property_unset(name)
    for name in masked_objects(bundle.path):
        group.drawn.add().name = name


def follow(scene: bpy.types.Scene, _bundle: Bundle) -> None:
    """Choose an edit that there is; a proxy that an earlier version has shown gets its legend."""
    group = scene.r2sego_proxy
    group.edit_index = min(group.edit_index, max(0, len(group.edits) - 1))
    shown = shown_proxy(scene, state.bundle_path(scene))
    if shown is not None and not legend_of(shown)[0]:
        colour_shown(scene)


def drawn_entry(group: bpy.types.PropertyGroup, name: str) -> R2SEGO_PG_drawn_object:
    """What Blender knows of an object's drawn masks, begun where it is nothing yet."""
    found = group.drawn.get(name)
    if found is None:
        found = group.drawn.add()
        found.name = name
        make_rows(len(group.objects))
    return found


def active_object(group: bpy.types.PropertyGroup) -> str:
    """The name of the chosen object, '' when there is none."""
    objects, index = group.objects, group.object_index
    return objects[index].name if 0 <= index < len(objects) else ""
