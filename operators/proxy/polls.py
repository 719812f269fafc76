"""What the proxy's operators need before they can run."""

import bpy

from ...r2sego_blender.bridge.proxy.show_proxy import shown_proxy
from ...r2sego_blender.core.errors import GeometryError
from .. import state
from ..base import leave_mode, needs_bundle, needs_round, require_visible
from .properties import active_object


def proxy_shown(context) -> bpy.types.Object:
    """The proxy's object. Raises GeometryError when none is shown."""
    shown = shown_proxy(context.scene, state.opened_bundle(context).path)
    if shown is None:
        raise GeometryError("no proxy is shown", cure="Press Show first.")
    return shown


def needs_proxy(cls, context) -> bool:
    """Poll of operators that work on the shown proxy."""
    if not needs_round(cls, context):
        return False
    if shown_proxy(context.scene, state.bundle_path(context.scene)) is None:
        cls.poll_message_set("No proxy is shown: press Show first")
        return False
    return True


def in_object_mode(context, shown: bpy.types.Object) -> None:
    """Leave Edit Mode, if the shown proxy is in it, with what is selected there."""
    if shown.mode == "EDIT":
        require_visible(context, shown)
        context.view_layer.objects.active = shown
        bpy.ops.object.mode_set(mode="OBJECT")


def show_selection(context, shown: bpy.types.Object) -> None:
    """Enter Edit Mode, where one sees which faces are selected; without a window there is no need."""
    if bpy.app.background or context.window is None or not shown.visible_get():
        return
    leave_mode(context)  # of the box
    context.view_layer.objects.active = shown
    context.tool_settings.mesh_select_mode = (False, False, True)
    bpy.ops.object.mode_set(mode="EDIT")


def needs_object(cls, context) -> bool:
    """Poll of operators that need a chosen object."""
    if not needs_bundle(cls, context):
        return False
    if not active_object(context.scene.r2sego_proxy):
        cls.poll_message_set("There is no object yet: press + beside the list to name one")
        return False
    return True


def object_named(context, name: str) -> str:
    """The object an operator is asked for, by default the chosen one. Raises GeometryError: none."""
    group = context.scene.r2sego_proxy
    found = name or active_object(group)
    if found not in group.objects:
        known = ", ".join(item.name for item in group.objects) or "none"
        raise GeometryError(f"there is no object '{found}'", cure=f"Use one of: {known}.")
    return found


def declared_object(context, name: str) -> str:
    """The same, of objects that the bundle knows already."""
    found = object_named(context, name)
    if not context.scene.r2sego_proxy.objects[found].declared:
        raise GeometryError(f"the bundle does not know '{found}' yet", cure="Declare its masks first.")
    return found
