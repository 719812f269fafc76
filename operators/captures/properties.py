"""What the room Captures remembers: how captures are shown, and what a person picked."""

import contextlib

import bpy
from bpy.props import BoolProperty, CollectionProperty, FloatProperty, IntProperty, StringProperty

from ...r2sego_blender.bridge.captures.show_captures import capture_camera, show_photographs, shows_older_captures
from ...r2sego_blender.bridge.shared.panel_facts import Fact, facts_of
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.core.errors import SceneError
from ...r2sego_blender.results.panels.picks import PickFacts
from ...r2sego_blender.results.panels.registration_pixels import next_name
from .. import state
from ..base import select_only
from .facts import CaptureFacts


def _picks_changed(group, context):
    state.catch_up(group.id_data)


def _renamed(point, context):
    """Lengths follow their point to its new name, which becomes one of its own."""
    scene = point.id_data
    group = scene.r2sego_captures
    others = [one.name for one in group.points if one != point]
    if not point.name or point.name in others:
        point.name = next_name(others)  # comes here again
        return
    for length in group.lengths:
        for end in ("start", "end"):
            if getattr(length, end) not in (point.name, *others):  # its name of before
                setattr(length, end, point.name)
    if len(point.views):
        state.catch_up(scene)


def _capture_chosen(group, context):
    """Selecting a line of the list selects the capture's camera."""
    scene = group.id_data
    name = group.captures[group.active_capture].name if len(group.captures) > group.active_capture else ""
    camera = capture_camera(scene, state.bundle_path(scene), name)
    if camera is not None:
        with contextlib.suppress(SceneError):  # a hidden one is chosen in the list alone
            select_only(context, camera)


def _capture_names(group, context, text):
    return [one.name for one in group.captures if text.lower() in one.name.lower()]


def _photographs_changed(group, context):
    show_photographs(group.id_data, state.bundle_path(group.id_data), group.show_photographs, group.photograph_opacity)


def _drawing_changed(group, context):
    redraw_views()


class R2SEGO_PG_pick(bpy.types.PropertyGroup):
    """A picked point's pixel in one capture."""

    capture: StringProperty()
    x_px: FloatProperty()
    y_px: FloatProperty()


class R2SEGO_PG_picked_point(bpy.types.PropertyGroup):
    """A point of the room, picked in one or more captures."""

    name: StringProperty(name="Name", description="What the point is called", update=_renamed)
    floor: BoolProperty(name="Floor", description="This point lies on the floor", update=_picks_changed)
    views: CollectionProperty(type=R2SEGO_PG_pick)

    @property
    def placed(self):
        """Where it lies and by how much it misses, a ``PlacedPick``; None where that is not known."""
        return facts_of(self.id_data, PickFacts).placed.get(self.name)


class R2SEGO_PG_picked_length(bpy.types.PropertyGroup):
    """A known length between two picked points."""

    start: StringProperty()
    end: StringProperty()
    metres: FloatProperty(
        name="Length",
        description="How far apart the two points are",
        default=1.0,
        min=0.01,
        max=100.0,
        subtype="DISTANCE",
        unit="LENGTH",
        precision=3,
        update=_picks_changed,
    )

    @property
    def error_m(self):
        """How much longer the picks have it, metres; None where that is not known."""
        return facts_of(self.id_data, PickFacts).lengths_m.get((self.start, self.end))


class R2SEGO_PG_residual(bpy.types.PropertyGroup):
    """One line of what the last correction left."""

    text: StringProperty()


class R2SEGO_PG_captures(bpy.types.PropertyGroup):
    """How captures are shown, and the picks of a registration by hand."""

    captures, corrections = Fact(CaptureFacts), Fact(CaptureFacts)
    fit_problem, fit_said, fit_warning = Fact(PickFacts), Fact(PickFacts), Fact(PickFacts)
    height_error_m = Fact(PickFacts)
    active_capture: IntProperty(
        name="Capture", description="The chosen capture; choosing one selects its camera", update=_capture_chosen
    )
    show_photographs: BoolProperty(
        name="Photographs",
        description="Photographs as the cameras' backgrounds",
        default=True,
        update=_photographs_changed,
    )
    photograph_opacity: FloatProperty(
        name="Opacity",
        description="Opacity of the photographs",
        default=0.6,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=_photographs_changed,
    )
    show_cloud: BoolProperty(
        name="Points",
        description="Draw the triangulated points over the 3D view",
        default=True,
        update=_drawing_changed,
    )
    point_size_px: FloatProperty(
        name="Point Size",
        description="Size of a drawn point",
        default=3.0,
        min=1.0,
        max=20.0,
        subtype="PIXEL",
        update=_drawing_changed,
    )
    show_labels: BoolProperty(
        name="Names",
        description="Write the captures' names beside their cameras",
        default=True,
        update=_drawing_changed,
    )
    show_picks: BoolProperty(
        name="Picks",
        description="Draw picked points, their misses and known lengths",
        default=True,
        update=_drawing_changed,
    )
    points: CollectionProperty(type=R2SEGO_PG_picked_point)
    active_point: IntProperty(name="Point", description="The chosen picked point")
    lengths: CollectionProperty(type=R2SEGO_PG_picked_length)
    use_camera_height: BoolProperty(
        name="Camera Height", description="A capture's height above the floor is known", update=_picks_changed
    )
    height_capture: StringProperty(
        name="Of",
        description="The capture whose height is known",
        update=_picks_changed,
        search=_capture_names,
        search_options=set(),
    )
    camera_height: FloatProperty(
        name="Height",
        description="Height of that capture's camera above the floor",
        default=1.5,
        min=0.05,
        max=10.0,
        subtype="DISTANCE",
        unit="LENGTH",
        precision=3,
        update=_picks_changed,
    )
    residuals: CollectionProperty(type=R2SEGO_PG_residual)

    @property
    def older(self):
        """Whether captures are shown where they stood before the world was corrected."""
        scene = self.id_data
        registration = facts_of(scene, CaptureFacts).registration
        return shows_older_captures(scene, state.bundle_path(scene), registration) if registration else False
