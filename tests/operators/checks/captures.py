"""What holds of the room Captures, checked inside Blender."""

import json

import bpy
from support import BUNDLE, open_bundle

OPERATORS = {"import_captures", "look_through"}


def check_import_captures():
    open_bundle()
    assert bpy.ops.r2sego.import_captures(points=True) == {"FINISHED"}
    assert [c.name for c in sorted(bpy.data.objects, key=lambda o: o.name) if c.type == "CAMERA"] == [
        "capture_0", "capture_1", "capture_2"
    ]  # fmt: skip
    bpy.context.view_layer.objects.active = bpy.data.objects["capture_2"]
    assert bpy.ops.r2sego.look_through() == {"FINISHED"}
    render = bpy.context.scene.render
    assert (render.resolution_x, render.resolution_y) == (60, 80)
    assert abs(render.pixel_aspect_x - 66.5 / 52.0) < 1e-6


def check_a_capture_sees_a_point_at_its_pixel():
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    open_bundle()
    bpy.ops.r2sego.import_captures()
    described = json.loads((BUNDLE / "captures" / "cameras.json").read_text())["captures"]
    for lens in described:
        seen_from = bpy.data.objects[lens["name"]]
        bpy.context.view_layer.objects.active = seen_from
        bpy.ops.r2sego.look_through()
        bpy.context.view_layer.update()
        local = Vector((0.3, -0.2, 2.0, 1.0))
        rows = [Vector(row) for row in lens["world_from_camera"]]
        point = Vector([row @ local for row in rows[:3]])
        x, y, depth = world_to_camera_view(bpy.context.scene, seen_from, point)
        assert abs(x * lens["width"] - (lens["fx"] * 0.15 + lens["cx"])) < 1e-3
        assert abs((1.0 - y) * lens["height"] - (lens["cy"] - lens["fy"] * 0.1)) < 1e-3
        assert abs(depth - 2.0) < 1e-5
