"""Polls of the room Views."""

from ..base import needs_round


def needs_candidates(cls, context) -> bool:
    """Poll of operators that need the round's candidate views."""
    if not needs_round(cls, context):
        return False
    if context.scene.r2sego_views.candidates == 0:
        cls.poll_message_set("This round has no candidate views yet: run Refine, which goes on where it ended")
        return False
    return True
