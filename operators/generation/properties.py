"""What a person chose in the sub-panel Generation: a view, and what is shown of it."""

import bpy
from bpy.props import EnumProperty, IntProperty, StringProperty

from ...r2sego_blender.bridge.shared.panel_facts import Fact
from ...r2sego_blender.results.panels.view_parts import KINDS
from .facts import GenerationFacts

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


class R2SEGO_PG_generation(bpy.types.PropertyGroup):
    """The generated views of the round."""

    views, accepted = Fact(GenerationFacts), Fact(GenerationFacts)
    active: IntProperty(name="View", description="The row of the active generated view", update=_view_changed)
    parts: EnumProperty(
        name="Parts", description="What stands side by side", items=PARTS, options={"ENUM_FLAG"}, default=DEFAULT_PARTS
    )
    truth: StringProperty(
        name="Ground Truth",
        subtype="FILE_PATH",
        description="A cameras.json with frozen views: the nearest one is shown beside, and nothing reads it",
    )
