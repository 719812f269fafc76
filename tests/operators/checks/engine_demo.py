"""What holds of the demo scene and of the view a room is first seen in, checked inside Blender."""

import shutil
import sys

import bpy
from left_jobs import followed_to_its_end, left_job, other_scene_shown, wait_until
from support import BUNDLE, MODULE, OUT, calls, conduct, open_bundle, startup_file, state


def check_the_demo_scene_is_one_command_and_is_shown():
    bpy.ops.wm.read_homefile(use_empty=True)
    conduct("succeed")
    folder = OUT.parent / "demo"
    shutil.copytree(BUNDLE, folder / "demo_room.r2s")  # what the stand-in does not make
    assert bpy.ops.r2sego.demo_scene(directory=str(folder)) == {"FINISHED"}
    bundle = str(folder / "demo_room.r2s")
    assert calls() == [["demo", bundle, "--preset", "preview", "--json-progress"]]
    presets = bpy.ops.r2sego.demo_scene.get_rna_type().properties["preset"].enum_items
    assert all(item.description for item in presets)
    assert state().bundle == bundle
    assert "Asset, final" in bpy.data.objects
    assert len([item for item in bpy.data.objects if item.type == "CAMERA"]) == 3


def check_the_demo_scene_is_opened_while_it_is_refined():
    startup_file()
    folder = OUT.parent / "begun_demo"
    conduct("sleep")
    job = left_job(bpy.ops.r2sego.demo_scene, directory=str(folder))
    following = sys.modules[f"{MODULE}.operators.engine.following"]
    following._tick()
    assert state().bundle == ""
    shutil.copytree(BUNDLE, folder / "demo_room.r2s")  # what the stand-in does not make
    following._tick()
    assert job.running()
    assert state().bundle == str(folder / "demo_room.r2s")
    assert sum("r2sego_capture" in item for item in bpy.data.objects) == 3
    assert bpy.context.window_manager.r2sego_engine.running_for.endswith(" min")
    assert not bpy.data.objects["Cube"].visible_get()
    bpy.ops.r2sego.cancel()
    wait_until(lambda: following._tick() and not bpy.context.window_manager.r2sego_job.running)
    assert state().bundle == str(folder / "demo_room.r2s")


def begin_in(folder, conducted):
    """The demo scene begun where one is already; what follows it."""
    shutil.copytree(BUNDLE, folder / "demo_room.r2s")
    conduct(conducted)
    left_job(bpy.ops.r2sego.demo_scene, directory=str(folder))
    return sys.modules[f"{MODULE}.operators.engine.following"]


def check_a_demo_scene_that_was_made_before_is_shown_too():
    startup_file()
    folder = OUT.parent / "old_demo"
    following = begin_in(folder, "succeed")
    wait_until(lambda: following._tick() and not bpy.context.window_manager.r2sego_job.running)
    (end,) = bpy.context.window_manager.r2sego_engine.ended
    assert (end.level, end.line) == ("INFO", "Made and refined demo_room.r2s")
    assert state().bundle == str(folder / "demo_room.r2s")
    assert "Asset, final" in bpy.data.objects
    assert not bpy.data.objects["Cube"].visible_get()


def check_a_bundle_that_is_open_stays_open_while_the_demo_scene_is_made():
    open_bundle()
    following = begin_in(OUT.parent / "other_demo", "slow")
    following._tick()
    assert state().bundle == str(BUNDLE)
    wait_until(lambda: following._tick() and not bpy.context.window_manager.r2sego_job.running)
    assert state().bundle == str(BUNDLE)
    (end,) = bpy.context.window_manager.r2sego_engine.ended
    assert end.line == "Demo Scene of demo_room.r2s: done"


def check_a_demo_scene_is_opened_in_the_blender_scene_it_was_started_from():
    """Another one is shown, and the first has another name, when there is something to see."""
    startup_file()
    first, folder = bpy.context.scene, OUT.parent / "demo_elsewhere"
    conduct("slow")
    left_job(bpy.ops.r2sego.demo_scene, directory=str(folder))
    other = other_scene_shown()
    first.name = "Renamed"
    shutil.copytree(BUNDLE, folder / "demo_room.r2s")  # what the stand-in does not make
    assert followed_to_its_end() == "Made and refined demo_room.r2s"
    assert first.r2sego.bundle == str(folder / "demo_room.r2s") and other.r2sego.bundle == ""
    assert "Asset, final" in first.objects and sum("r2sego_capture" in one for one in first.objects) == 3
    assert not len(other.objects) and bpy.context.scene == other


def check_a_view_looks_into_a_room_where_its_captures_look():
    import numpy as np

    room_view = sys.modules[f"{MODULE}.operators.room_view"]
    # Along +y, and halfway between +x and +y.
    assert abs(room_view.heading_rad(np.array([[0.0, 1.0, 0.2], [0.0, 1.0, -0.2]]))) < 1e-9
    assert abs(room_view.heading_rad(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])) + np.pi / 4.0) < 1e-9
    open_bundle()
    bpy.ops.r2sego.import_captures()
    bpy.context.view_layer.update()
    area = next(area for area in bpy.context.screen.areas if area.type == "VIEW_3D")
    view = area.spaces.active.region_3d
    cameras = [item for item in bpy.data.objects if "r2sego_capture" in item]
    points = np.random.default_rng(1).uniform((-1.0, 0.0, 0.0), (3.0, 5.0, 2.0), (500, 3))
    points[0] = (0.0, 90.0, 0.0)  # one that is wrong
    for camera in cameras:
        camera.location = (1.0, 2.5, 1.0)
    bpy.context.view_layer.update()
    cv_from_gl = np.diag([1.0, -1.0, -1.0, 1.0])
    room_view.look_into(view, points, np.array([np.array(one.matrix_world) @ cv_from_gl for one in cameras]))
    towards = -(view.view_rotation.to_matrix().col[2])
    looks = np.mean([-np.array(camera.matrix_world.col[2][:3]) for camera in cameras], axis=0)
    assert towards.z < -0.5 and np.dot(towards[:2], looks[:2]) > 0.0
    assert np.allclose(view.view_location, (1.0, 2.5, 1.0), atol=0.2)
    assert 6.7 < view.view_distance < 8.0  # the room's diagonal is 6.7 m


def check_a_startup_cube_that_was_touched_stays():
    room_view = sys.modules[f"{MODULE}.operators.room_view"]
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(0.0, 1.0, 0.0))
    cube = bpy.context.object
    bpy.context.view_layer.update()
    room_view.hide_startup_cube(bpy.context.scene)
    assert cube.visible_get()
    cube.location = (0.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    room_view.hide_startup_cube(bpy.context.scene)
    assert not cube.visible_get()
