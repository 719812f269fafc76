"""What the sub-panel Views shows of the round's candidates, and how."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)

from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.bridge.views.show_candidates import mark_candidate, shown_candidates
from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.view_scores import remembered_in
from .. import state
from . import display

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
        scene.r2sego.problem = str(error)


def _active_changed(group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    """Keep to a candidate that there is; its words, its mark in the view and its row of the list."""
    scene = group.id_data
    scores = remembered_in(scene)
    active = group.active
    if scores is None:
        group.why = group.figures = ""
        return
    if active >= len(scores):
        group.active = len(scores) - 1  # comes here again
        return
    if active < 0:
        group.why = group.figures = ""
    else:
        views = scores.views
        group.why = scores.why(active)
        group.figures = (
            f"u {views.deficit[active]:.1%}   g {views.availability[active]:.1%}   "
            f"s {views.score[active]:.3f}"
        )
        group.active_frame, group.active_rollout = int(views.frame[active]), int(views.rollout[active])
        group.rollout = group.active_rollout
    row = next((k for k, item in enumerate(group.ranked) if item.candidate == active), -1)
    if group.ranked_index != row:
        group.ranked_index = row
    if state.may_show() and shown_candidates(scene, scores.bundle_path) is not None:
        mark_candidate(scene, scores.bundle_path, scores.views, active, group.frustum_size)
    redraw_views()


def _row_changed(group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    """The row chosen in the list is the active candidate."""
    if 0 <= group.ranked_index < len(group.ranked):
        candidate = group.ranked[group.ranked_index].candidate
        if group.active != candidate:
            group.active = candidate


def _rollout_changed(group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    last = max(0, group.rollouts - 1)
    if group.rollout > last:
        group.rollout = last
        return
    scores = remembered_in(group.id_data)
    group.origin = "" if scores is None else scores.origin(group.rollout)
    redraw_views()


def _curves_changed(_group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    redraw_views()


class R2SEGO_PG_ranked_view(bpy.types.PropertyGroup):
    """A row of the list: a target view, or one that may stand in for a target."""

    candidate: IntProperty(name="Candidate", description="Its number in the candidate stream")
    rollout: IntProperty(name="Rollout", description="The rollout that reached it, from 0")
    frame: IntProperty(name="Frame", description="Its frame of the rollout")
    score: FloatProperty(name="Score", description="s = u g")
    chosen: BoolProperty(name="Target", description="Whether it is a target view")


class R2SEGO_PG_views(bpy.types.PropertyGroup):
    """The candidate views of the round."""

    colour_by: EnumProperty(
        name="Colour", description="What the frusta's colours mean, dark blue 0 to yellow the best",
        items=COLOURS, update=_display_changed,
    )  # fmt: skip
    shown: EnumProperty(
        name="Shown", description="Which candidate views are shown", items=SHOWN, update=_display_changed
    )
    frustum_size: FloatProperty(
        name="Frustum Size", description="Depth of a candidate's frustum", default=0.08, min=0.005, max=5.0,
        subtype="DISTANCE", unit="LENGTH", update=_display_changed,
    )  # fmt: skip
    active: IntProperty(
        name="Candidate", description="The active candidate's number in the candidate stream, -1 for none",
        default=-1, min=-1, update=_active_changed,
    )  # fmt: skip
    active_frame: IntProperty(name="Frame", description="The active candidate's frame of its rollout")
    active_rollout: IntProperty(name="Rollout", description="The active candidate's rollout, from 0")
    rollout: IntProperty(
        name="Rollout", description="The rollout whose scores are drawn over time, from 0", min=0,
        update=_rollout_changed,
    )  # fmt: skip
    origin: StringProperty(name="Attempt", description="Which attempt of the round the rollout is")
    curves: BoolProperty(
        name="Scores over Time", update=_curves_changed,
        description="Draw u, g and s of the rollout's frames at the bottom of the 3D view",
    )  # fmt: skip
    set_frame: BoolProperty(
        name="Set Timeline", description="Go to the frame of a candidate that is picked", default=True
    )
    why: StringProperty(name="Reason", description="Why the active candidate is a target or none")
    figures: StringProperty(name="Scores", description="The active candidate's scores")
    ranked: CollectionProperty(type=R2SEGO_PG_ranked_view)
    ranked_index: IntProperty(
        name="Target", description="The row of the active candidate", default=-1, update=_row_changed
    )
    candidates: IntProperty(name="Candidates", description="How many candidates the round has")
    survivors: IntProperty(name="Survivors", description="How many temporal suppression left")
    rollouts: IntProperty(name="Rollouts", description="How many rollouts the candidates are of")
    best_s: FloatProperty(name="Best Score", description="The best score of the round")
    best_u: FloatProperty(name="Largest Deficit", description="The largest deficit of the round")
    best_g: FloatProperty(name="Best Availability", description="The best availability of the round")
    note: StringProperty(name="Note", description="What is out of the ordinary in the selection")
    stamp: StringProperty(name="Stamp", description="Which selection these facts are of")
