"""What the operators on generated views share: which view is meant, and when they can be used."""

import bpy
from bpy.props import IntProperty

from ...r2sego_blender.core.errors import GenerationError
from ...r2sego_blender.generation.view_records import ViewRecord
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.view_parts import require_view, views_of_round
from .. import state
from ..base import needs_round


class OfOneView:
    """An operator on one generated view, by its rank; -1 means the list's active one."""

    view: IntProperty(
        name="View",
        description="The view's rank, from 0; -1 takes the list's active one",
        default=-1,
        min=-1,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        return needs_views(cls, context)

    def rank(self, context: bpy.types.Context) -> int:
        """The rank that is meant. Raises GenerationError when none is."""
        if self.view >= 0:
            return self.view
        group = context.scene.r2sego_generation
        if not 0 <= group.active < len(group.views):
            raise GenerationError("no view is chosen", cure="Choose one in the list.")
        return group.views[group.active].rank

    def chosen(self, context: bpy.types.Context) -> tuple[Bundle, int, ViewRecord]:
        """The bundle, the round that is shown and the view. Raises GenerationError without one."""
        bundle, shown = state.opened_bundle(context), context.scene.r2sego.round_index
        return bundle, shown, require_view(views_of_round(bundle, shown), self.rank(context))


def needs_views(cls, context) -> bool:
    """Poll of operators that need the round's generated views."""
    if not needs_round(cls, context):
        return False
    if not len(context.scene.r2sego_generation.views):
        cls.poll_message_set("This round has no generated views yet: run Refine, which goes on where it ended")
        return False
    return True
