"""What holds of pictures of the asset, rendered and compared, checked inside Blender."""

import contextlib
import importlib
import json
from pathlib import Path

import bpy
import numpy as np
from shown_asset import group
from support import BUNDLE, MODULE, calls, conduct, copied_bundle, open_bundle, open_here, refused


def check_pictures_and_ground_truth_of_another_bundle_are_not_compared():
    copy, picture = copied_bundle(), bpy.data.images.new("left", 4, 3)
    views = bpy.context.scene.r2sego_generation
    group().compare, group().wipe_left, views.truth = True, picture, "/a/cameras.json"
    open_here(copy)  # again
    assert group().compare and group().wipe_left == picture and views.truth
    open_here(BUNDLE)
    assert not group().compare and group().wipe_left is None and not views.truth
    bpy.data.images.remove(picture)


def check_a_camera_is_handed_to_the_engine_exactly():
    copy = copied_bundle()
    bpy.ops.r2sego.import_captures()
    conduct("fail")
    assert "images/a.png" in refused(bpy.ops.r2sego.render_asset, camera="capture_1", stage="0")
    (call,) = calls()
    assert call[:2] == ["render", str(copy)] and call[6:] == ["--round", "0", "--pass", "colour", "--json-progress"]
    (camera,) = json.loads(Path(call[3]).read_text())["cameras"]
    lens = json.loads((copy / "captures" / "cameras.json").read_text())["captures"][1]
    for name in ("width", "height", "fx", "fy", "cx", "cy", "world_from_camera"):
        np.testing.assert_allclose(camera[name], lens[name], atol=1e-5)


def check_a_second_render_takes_the_camera_and_asset_of_then():
    """As pressed in a window, where Blender keeps what an operator was called with."""
    copied_bundle()
    bpy.ops.r2sego.import_captures()
    conduct("fail")
    first, second = (bpy.data.objects[f"capture_{k}"] for k in (0, 1))
    told = []
    for camera, stage in ((first, 0), (second, 1)):
        bpy.context.view_layer.objects.active = camera
        group().stage = stage
        with contextlib.suppress(RuntimeError):
            bpy.ops.r2sego.render_asset("EXEC_DEFAULT", True)
        call = calls()[-1]
        (handed,) = json.loads(Path(call[3]).read_text())["cameras"]
        told.append((call[call.index("--round") + 1], np.array(handed["world_from_camera"])))
    (one_stage, one_pose), (other_stage, other_pose) = told
    assert one_stage != other_stage
    assert np.abs(one_pose - other_pose).max() > 0.01


def check_any_perspective_camera_is_a_pinhole_in_pixels():
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    copied_bundle()
    scene, data = bpy.context.scene, bpy.data.cameras.new("own")
    own = bpy.data.objects.new("own", data)
    scene.collection.objects.link(own)
    own.location, own.rotation_euler, own.scale = (0.4, -3.0, 1.1), (1.4, 0.1, 0.3), (2.0, 2.0, 2.0)
    point = Vector((0.3, 0.2, 1.0))
    render = scene.render
    for fit, size, aspect in (("AUTO", (320, 200), 1.0), ("AUTO", (200, 320), 1.5), ("VERTICAL", (320, 200), 1.5)):
        data.sensor_fit, data.shift_x, data.shift_y, data.lens = fit, 0.13, -0.07, 28.0
        render.resolution_x, render.resolution_y = size
        render.pixel_aspect_x, render.pixel_aspect_y = 1.0, aspect
        conduct("fail")
        refused(bpy.ops.r2sego.render_asset, camera="own")
        (camera,) = json.loads(Path(calls()[0][3]).read_text())["cameras"]
        local = np.linalg.inv(camera["world_from_camera"]) @ (*point, 1.0)
        x, y, _ = world_to_camera_view(scene, own, point)
        np.testing.assert_allclose(camera["fx"] * local[0] / local[2] + camera["cx"], x * size[0], atol=1e-2)
        np.testing.assert_allclose(camera["fy"] * local[1] / local[2] + camera["cy"], (1 - y) * size[1], atol=1e-2)
    for scale in ((-1.0, 1.0, 1.0), (0.0, 0.0, 0.0)):
        own.scale = scale
        assert "own: this camera is mirrored or skewed" in refused(bpy.ops.r2sego.render_asset, camera="own")
    own.scale = (1.0, 1.0, 1.0)
    data.type = "ORTHO"
    assert "no perspective camera" in refused(bpy.ops.r2sego.render_asset, camera="own")


def check_two_pictures_are_compared():
    open_bundle()
    assert "Compare two pictures first" in refused(bpy.ops.r2sego.move_wipe)
    bpy.ops.r2sego.import_captures()
    assert bpy.ops.r2sego.compare_photograph(side="RIGHT") == {"FINISHED"}
    assert group().compare and group().wipe_right.name == "capture_0.png" and group().wipe_left is None
    assert bpy.ops.r2sego.move_wipe(factor=0.25) == {"FINISHED"}
    assert abs(group().wipe - 0.25) < 1e-6


def check_a_compared_picture_is_drawn_in_its_own_view_alone():
    compared = importlib.import_module(f"{MODULE}.panels.overlays.wipe").compared
    open_bundle()
    bpy.ops.r2sego.import_captures()
    scene, any_picture = bpy.context.scene, bpy.data.images.new("opened from disk", 4, 4)
    bpy.ops.r2sego.compare_photograph(side="LEFT")
    group().wipe_right = any_picture
    own, other = (bpy.data.objects[f"capture_{index}"] for index in (0, 1))
    for camera, left in ((own, group().wipe_left), (other, None), (own, group().wipe_left)):
        scene.camera = camera
        assert compared(scene) == (left, any_picture), camera.name
    own.location.x += 0.1
    bpy.context.view_layer.update()
    assert compared(scene) == (None, any_picture)
