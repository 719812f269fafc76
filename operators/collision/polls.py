"""What the collision's operators need before they can run."""

from ..base import needs_bundle


def needs_collision(cls, context) -> bool:
    """Poll of operators that need a collision surface."""
    if not needs_bundle(cls, context):
        return False
    if not context.scene.r2sego.has_collision:
        cls.poll_message_set("There is no collision surface yet: run Refine first")
        return False
    return True
