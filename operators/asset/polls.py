"""Polls of the room Asset."""

from ...r2sego_blender.bridge.asset.show_asset import is_deleted
from ..base import needs_bundle


def needs_asset(cls, context) -> bool:
    """Poll of operators that need an asset in the bundle."""
    if not needs_bundle(cls, context):
        return False
    if not context.scene.r2sego_asset.stages:
        cls.poll_message_set("There is no asset yet: run Refine first")
        return False
    return True


def needs_shown_asset(cls, context) -> bool:
    """Poll of operators on the splats that are shown."""
    if not needs_asset(cls, context):
        return False
    shown = context.scene.r2sego_asset.shown
    if shown is None or is_deleted(shown):
        cls.poll_message_set("Show the asset first: press Show Asset")
        return False
    return True


def needs_splats_at_rest(cls, context) -> bool:
    """Poll of operators that write the shown splats' attributes, which Edit Mode does not let."""
    return needs_shown_asset(cls, context) and needs_no_edit_mode(cls, context)


def needs_no_edit_mode(cls, context) -> bool:
    """Poll of operators that write the attributes of the splats where some are shown."""
    shown = context.scene.r2sego_asset.shown
    if shown is not None and shown.mode == "EDIT":
        cls.poll_message_set("Leave Edit Mode first (Tab), or press Mark Selected")
        return False
    return True
