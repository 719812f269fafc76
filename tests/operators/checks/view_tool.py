"""What holds of the tools that the mouse works in a 3D view, checked inside Blender without a window."""

import importlib
from types import SimpleNamespace

import bpy
from support import MODULE, open_bundle

MOVED = SimpleNamespace(type="MOUSEMOVE", value="NOTHING", mouse_x=0, mouse_y=0)


def tools():
    """The module of the tools, as the add-on has loaded it."""
    return importlib.import_module(f"{MODULE}.operators.view_tool")


def view():
    """The first 3D view of Blender's window."""
    return next(area for area in bpy.context.screen.areas if area.type == "VIEW_3D")


class Said(list):
    """What a tool reports."""

    def __call__(self, kinds, text):
        self.append((*kinds, text))


def begun(on_event=lambda context, event: {"RUNNING_MODAL"}):
    """A tool at work in the first 3D view, that notes what it hears."""

    class Tool(tools().ViewTool):
        bl_label = "Draw Something"

        def on_event(self, context, event):
            self.heard.append((context.area, context.region.type, event.type))
            return on_event(context, event)

        def on_leave(self, context):
            self.left += 1

    tool = Tool()
    tool.heard, tool.left, tool.report = [], 0, Said()
    tool._held = tools().HeldView(view(), bpy.context.scene)
    return tool


def check_a_tool_hears_events_with_the_view_as_context():
    open_bundle()
    tool, area = begun(), view()
    assert tool.modal(bpy.context, MOVED) == {"RUNNING_MODAL"}
    assert tool.heard == [(area, "WINDOW", "MOUSEMOVE")] and not tool.left


def check_a_tool_ends_with_a_sentence_when_its_view_is_gone():
    open_bundle()
    for changed, ended in ((False, {"CANCELLED"}), (True, {"FINISHED"})):
        tool, area = begun(), view()
        tool.changed = changed
        area.type = "CONSOLE"
        assert tool.modal(bpy.context, MOVED) == ended
        assert not tool.heard and tool.left == 1
        ((kind, text),) = tool.report
        assert kind == "WARNING" and text.startswith("Draw Something ended: its 3D view was closed"), text
        area.type = "VIEW_3D"


def check_a_tool_ends_when_another_scene_is_chosen():
    open_bundle()
    tool, scene = begun(), bpy.context.scene
    other = bpy.data.scenes.new("Other")
    bpy.context.window.scene = other
    assert tool.modal(bpy.context, MOVED) == {"CANCELLED"} and tool.left == 1
    assert "another scene was chosen" in tool.report[0][1]
    bpy.context.window.scene = scene


def check_a_tool_outlives_undo():
    open_bundle()
    bpy.ops.ed.undo_push(message="before")
    tool = begun()
    bpy.data.objects.new("something", None)
    bpy.ops.ed.undo_push(message="something")
    bpy.ops.ed.undo()
    assert tool.modal(bpy.context, MOVED) == {"RUNNING_MODAL"} and not tool.report


def check_a_tool_is_left_when_the_addon_is_disabled():
    open_bundle()
    tool = begun()
    tools()._at_work.append(tool)
    tools().leave_tools()
    tools().leave_tools()
    assert tool.left == 1


def check_an_error_ends_a_tool_cleanly():
    errors = importlib.import_module(f"{MODULE}.r2sego_blender.core.errors")
    open_bundle()

    def refuse(context, event):
        raise errors.SceneError("the room is dark", cure="Put on the light.")

    tool = begun(refuse)
    assert tool.modal(bpy.context, MOVED) == {"CANCELLED"} and tool.left == 1
    assert tool.report == [("ERROR", "The room is dark. Put on the light.")]

    def break_off(context, event):
        raise ZeroDivisionError

    tool = begun(break_off)
    try:
        tool.modal(bpy.context, MOVED)
    except ZeroDivisionError:
        assert tool.left == 1
    else:
        raise AssertionError("a programmer's error was hidden")


def check_a_tool_begins_in_a_3d_view_alone():
    open_bundle()
    tool = begun()
    assert tool.start_tool(bpy.context) == {"CANCELLED"}
    assert tool.report == [("ERROR", "Press Draw Something in a 3D view")]
