"""What a person chose in the sub-panel Views: how candidates are shown, and which one is active."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ...r2sego_blender.bridge.shared.panel_facts import Fact
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.bridge.views.show_candidates import mark_candidate, shown_candidates
from ...r2sego_blender.core.errors import R2SEgoError
from .. import state
from . import display
from .facts import ViewFacts

COLOURS = [
    ("S", "Score", "The score s = u g, by which views are chosen"),
    ("U", "Deficit", "The share u of a view's pixels that the asset lacks"),
    ("G", "Availability", "The share g of a view's pixels that the proxy can render"),
]
SHOWN = [
    ("ALL", "All", "Every candidate view"),
    ("SURVIVORS", "Survivors", "Those that temporal suppression left"),
    ("TARGETS", "Targets", "Those that are generated"),
]


def _display_changed(group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    """The frusta, where they are shown, become those that are asked for."""
    scene = group.id_data
    try:
        display.follow(scene)
    except R2SEgoError as error:
        state.tell_problem(scene, error)


def _active(group: bpy.types.PropertyGroup) -> int:
    scores = group.scores
    return group.picked if scores is not None and group.picked_of == scores.mark else -1


def _pick(group: bpy.types.PropertyGroup, candidate: int) -> None:
    """Keep to a candidate that there is, and to the selection it was picked in; mark it in the view."""
    scene, scores = group.id_data, group.scores
    if scores is None:
        return
    group.picked, group.picked_of = min(candidate, len(scores) - 1), scores.mark
    if group.picked >= 0:
        group.rollout = group.active_rollout
    if shown_candidates(scene, scores.bundle_path) is not None:
        mark_candidate(scene, scores.bundle_path, scores.views, group.picked, group.frustum_size)
    redraw_views()


def _row(group: bpy.types.PropertyGroup) -> int:
    return -1 if group.scores is None else group.scores.row_of.get(group.active, -1)


def _pick_row(group: bpy.types.PropertyGroup, row: int) -> None:
    if 0 <= row < len(group.ranked):
        group.active = group.ranked[row].candidate


def _rollout_changed(group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    last = max(0, group.rollouts - 1)
    if group.rollout > last:
        group.rollout = last
        return
    redraw_views()


def _curves_changed(_group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    redraw_views()


class R2SEGO_PG_views(bpy.types.PropertyGroup):
    """The candidate views of the round."""

    colour_by: EnumProperty(
        name="Colour",
        description="What the frusta's colours mean, dark blue 0 to yellow the best",
        items=COLOURS,
        update=_display_changed,
    )
    shown: EnumProperty(
        name="Shown", description="Which candidate views are shown", items=SHOWN, update=_display_changed
    )
    frustum_size: FloatProperty(
        name="Frustum Size",
        description="Depth of a candidate's frustum",
        default=0.08,
        min=0.005,
        max=5.0,
        subtype="DISTANCE",
        unit="LENGTH",
        update=_display_changed,
    )
    active: IntProperty(
        name="Candidate",
        description="The active candidate's number in the candidate stream, -1 for none",
        default=-1,
        min=-1,
        get=_active,
        set=_pick,
    )
    picked: IntProperty(default=-1)
    picked_of: StringProperty(description="The selection in which it was picked: in another it is none")
    rollout: IntProperty(
        name="Rollout",
        description="The rollout whose scores are drawn over time, from 0",
        min=0,
        update=_rollout_changed,
    )
    curves: BoolProperty(
        name="Scores over Time",
        update=_curves_changed,
        description="Draw u, g and s of the rollout's frames at the bottom of the 3D view",
    )
    set_frame: BoolProperty(
        name="Set Timeline", description="Go to the frame of a candidate that is picked", default=True
    )
    ranked_index: IntProperty(
        name="Target", description="The row of the active candidate", default=-1, get=_row, set=_pick_row
    )
    scores = Fact(ViewFacts)
    ranked, candidates, rollouts = Fact(ViewFacts), Fact(ViewFacts), Fact(ViewFacts)

    @property
    def active_frame(self) -> int:
        """The active candidate's frame of its rollout."""
        return int(self.scores.selection.frame[self.active])

    @property
    def active_rollout(self) -> int:
        """The active candidate's rollout, from 0."""
        return int(self.scores.selection.rollout[self.active])

    @property
    def why(self) -> str:
        """Why the active candidate is a target or none."""
        return "" if self.active < 0 else self.scores.why(self.active)

    @property
    def figures(self) -> str:
        """The active candidate's scores."""
        return "" if self.active < 0 else self.scores.figures(self.active)

    @property
    def origin(self) -> str:
        """Which attempt of the round the rollout is."""
        return "" if self.scores is None else self.scores.origin(self.rollout)
