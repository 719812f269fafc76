"""What the sub-panel Generation shows of a round's generated views."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, IntProperty, StringProperty

from ...r2sego_blender.results.panels.view_parts import KINDS

PARTS = [
    (kind.upper(), kind.capitalize(), shown[:1].upper() + shown[1:], 1 << place)
    for place, (kind, shown) in enumerate(KINDS.items())
]
DEFAULT_PARTS = {kind.upper() for kind in KINDS} - {"PROVENANCE", "CONFIDENCE"}


def _view_changed(group: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    """The candidate of the active view is the active candidate."""
    if 0 <= group.active < len(group.views):
        shown = group.id_data.r2sego_views
        candidate = group.views[group.active].candidate
        if shown.active != candidate < shown.candidates:
            shown.active = candidate


class R2SEGO_PG_generated_view(bpy.types.PropertyGroup):
    """A row of the list: a generated view and what became of it."""

    rank: IntProperty(name="View", description="Its rank in the selection, from 0")
    candidate: IntProperty(name="Candidate", description="Its number in the candidate stream")
    title: StringProperty(name="Candidate", description="Its rollout and frame")
    reference: StringProperty(name="Reference", description="The photograph the clip starts at")
    accepted: BoolProperty(name="Accepted", description="Whether the asset is trained on it")
    by_hand: BoolProperty(name="By Hand", description="Whether a person decided so")
    fate: StringProperty(name="Reason", description="Why it was accepted or rejected")
    registration: StringProperty(
        name="Registration", description="What of its picture agrees with the captures"
    )
    residual: StringProperty(name="Residual", description="From where it was wanted to where it was found")
    doubt: StringProperty(name="Uncertainty", description="Standard deviations of the estimated pose")
    stands_in: StringProperty(name="Replacement", description="Which view it replaces, or is replaced by")
    note: StringProperty(name="Path", description="What is out of the ordinary on the camera's way")
    has_clip: BoolProperty(name="Clip", description="Whether a clip was generated")


class R2SEGO_PG_generation(bpy.types.PropertyGroup):
    """The generated views of the round."""

    views: CollectionProperty(type=R2SEGO_PG_generated_view)
    active: IntProperty(name="View", description="The row of the active generated view", update=_view_changed)
    accepted: IntProperty(name="Accepted", description="How many views the asset is trained on")
    parts: EnumProperty(
        name="Parts", description="What stands side by side", items=PARTS, options={"ENUM_FLAG"},
        default=DEFAULT_PARTS,
    )  # fmt: skip
    truth: StringProperty(
        name="Ground Truth", subtype="FILE_PATH",
        description="A cameras.json with frozen views: the nearest one is shown beside, and nothing reads it",
    )  # fmt: skip
