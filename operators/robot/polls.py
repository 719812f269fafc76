"""What the operators of a policy's evaluation need before they can run."""

from ..base import needs_bundle


def needs_evaluation(cls, context) -> bool:
    """Poll of operators that show a policy's recorded episodes."""
    if not needs_bundle(cls, context):
        return False
    if context.scene.r2sego_robot.evaluation is None:
        cls.poll_message_set("No policy was evaluated here yet: press Evaluate under Policy")
        return False
    return True
