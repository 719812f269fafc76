"""What the operators of trials need before they can run."""

from ..base import needs_own_scene
from . import facts


def needs_study(cls, context) -> bool:
    """Poll of operators that need an open study."""
    if not context.scene.r2sego_trials.study:
        cls.poll_message_set("Open a study first: press New or Open under Trials")
        return False
    if facts.of(context.scene).plan is None:
        cls.poll_message_set("The study cannot be read: open it again, the panel says why")
        return False
    return needs_own_scene(cls, context)
