"""Rollouts in Blender: at every frame each body and the camera stand where MuJoCo puts them."""

import json
import shutil

import fake_rollouts
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

from r2sego_blender.bridge.robot import robot_playback, show_robot  # noqa: E402
from r2sego_blender.bridge.shared.cameras import camera_of  # noqa: E402
from r2sego_blender.bridge.shared.outliner import find_collection  # noqa: E402
from r2sego_blender.core.errors import SceneError  # noqa: E402
from r2sego_blender.results.panels.bundle import Bundle  # noqa: E402
from r2sego_blender.results.panels.rollout_bodies import RobotBodies  # noqa: E402
from r2sego_blender.results.panels.rollout_list import TRIAL, camera_poses  # noqa: E402


@pytest.fixture(autouse=True)
def playback():
    """The timeline is followed, as while the add-on is enabled."""
    robot_playback.register()
    yield
    robot_playback.unregister()


def shown_matrices(frame):
    bpy.context.scene.frame_set(frame)
    return {shown.name: np.array(shown.matrix_world, np.float64) for shown in bpy.context.scene.objects}


def check_frames(bundle, round_index, numbers, frames):
    bodies = RobotBodies.load(bundle, round_index)
    for frame in frames:
        shown = shown_matrices(frame)
        for number in numbers:
            poses, cameras = bodies.poses(number), camera_poses(bundle, round_index, number)
            at = min(frame, len(poses) - 1)
            for index, name in enumerate(bodies.names):
                error = shown[f"Robot {name}, rollout {number}"] - poses[at, index]
                assert np.abs(error).max() < 1e-5, (frame, name)
            camera = camera_of(bpy.data.objects[f"Head camera {number}"])
            assert np.abs(camera.world_from_camera - cameras[at]).max() < 1e-5
            assert (camera.fx, camera.width) == (bodies.camera.fx, bodies.camera.width)


def test_every_body_is_where_mujoco_puts_it_at_every_frame(scene, bundle):
    roots = show_robot.show_rollouts(scene, bundle, 0, [0])
    assert [root.name for root in roots] == ["Rollout 0"]
    assert (scene.frame_start, scene.frame_end) == (0, 10)
    assert scene.render.fps / scene.render.fps_base == pytest.approx(5.0)
    check_frames(bundle, 0, [0], range(11))
    check_frames(bundle, 0, [0], reversed(range(14)))  # behind its end it stays there


def test_the_time_of_a_scene_that_a_person_has_animated_stays(scene, bundle):
    scene.render.fps, scene.render.fps_base, scene.frame_start, scene.frame_end = 24, 1.0, 1, 250
    own = bpy.data.objects.new("own", None)
    scene.collection.objects.link(own)
    own.keyframe_insert("location", frame=30)
    show_robot.show_rollouts(scene, bundle, 0, [0])
    assert (scene.render.fps, scene.render.fps_base) == (24, 1.0)
    assert (scene.frame_start, scene.frame_end) == (1, 250)
    check_frames(bundle, 0, [0], (0, 7))
    bpy.data.objects.remove(own)
    show_robot.show_rollouts(scene, bundle, 0, [0])
    assert (scene.frame_start, scene.frame_end) == (0, 10)


def test_several_are_shown_together(scene, bundle):
    roots = show_robot.show_rollouts(scene, bundle, 0, [0, 1, 3])
    assert len(roots) == 3
    bodies = RobotBodies.load(bundle, 0)
    assert len(scene.objects) == 3 * (len(bodies.names) + 2)
    assert len([mesh for mesh in bpy.data.meshes if mesh.users]) == len(bodies.names)  # shared
    check_frames(bundle, 0, [0, 1, 3], range(11))
    assert show_robot.are_shown(scene, bundle, 0, [0, 1, 3])
    assert not show_robot.are_shown(scene, bundle, 0, [0, 1])
    assert not show_robot.are_shown(scene, bundle, 1, [0, 1, 3])


def test_the_empty_goes_with_the_first_body(scene, bundle):
    (root,) = show_robot.show_rollouts(scene, bundle, 0, [3])
    first = f"Robot {RobotBodies.load(bundle, 0).names[0]}, rollout 3"
    for frame in (0, 5):
        shown = shown_matrices(frame)
        np.testing.assert_allclose(shown[root.name][:3, 3], shown[first][:3, 3], atol=1e-6)
        np.testing.assert_allclose(shown[root.name][:3, :3], np.eye(3), atol=1e-6)


def test_views_draw_fewer_faces_of_each_robot_if_asked_and_renders_all(scene, bundle):
    show_robot.show_rollouts(scene, bundle, 0, [0, 1])
    robots = [
        [part for part in root.children if part.type == "MESH"]
        for root in scene.objects
        if root.name.startswith("Rollout ")
    ]
    whole = sum(len(part.data.polygons) for part in robots[0])
    simplest = 32 * len(robots[0])
    most = 2 * max(simplest, whole // 3)

    def drawn(parts):
        depsgraph = bpy.context.evaluated_depsgraph_get()
        return sum(len(part.evaluated_get(depsgraph).data.polygons) for part in parts)

    assert len(robots) == 2 and whole > most // 2
    show_robot.draw_fewer_faces_of_robots(most)
    for parts in robots:
        assert drawn(parts) <= 1.05 * (most // 2 + simplest) and drawn(parts) < whole
        assert not any(modifier.show_render for part in parts for modifier in part.modifiers)
    show_robot.draw_fewer_faces_of_robots(0)
    assert [drawn(parts) for parts in robots] == [whole, whole]


def test_another_rollout_takes_its_place(scene, bundle):
    show_robot.show_rollouts(scene, bundle, 0, [0, 1])
    count = len(bpy.data.objects)
    show_robot.show_rollouts(scene, bundle, TRIAL, [1])
    assert len(bpy.data.objects) == count // 2
    assert (scene.frame_start, scene.frame_end) == (0, 4)
    check_frames(bundle, TRIAL, [1], range(5))


def test_the_head_camera_becomes_the_scenes(scene, bundle):
    show_robot.show_rollouts(scene, bundle, 0, [3, 1], look_through=True)
    assert scene.camera.name == "Head camera 3"
    assert (scene.render.resolution_x, scene.render.resolution_y) == (64, 48)


def test_it_moves_again_after_the_file_was_loaded(scene, bundle, tmp_path):
    show_robot.show_rollouts(scene, bundle, 0, [1])
    bpy.data.objects["Robot base, rollout 1"].name = "renamed"
    blend = tmp_path / "kept.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    bpy.data.objects["renamed"].name = "Robot base, rollout 1"
    check_frames(bundle, 0, [1], range(5))


def test_a_bundle_that_has_changed_or_gone_leaves_the_robot_where_it_is(scene, bundle_path, tmp_path):
    shutil.copytree(bundle_path, tmp_path / "room.r2s")
    bundle = Bundle.open(tmp_path / "room.r2s")
    show_robot.show_rollouts(scene, bundle, 0, [0])
    before = shown_matrices(3)
    robot_playback.forget()
    described = bundle.path / "rounds/0/bodies/bodies.json"
    described.write_text(json.dumps({**json.loads(described.read_text()), "rollouts": "of others"}))
    after = shown_matrices(7)
    assert all((after[name] == before[name]).all() for name in before)
    robot_playback.forget()
    shutil.rmtree(bundle.path)
    assert all((shown_matrices(9)[name] == before[name]).all() for name in before)


def test_what_cannot_be_shown_changes_nothing(scene, bundle):
    show_robot.show_rollouts(scene, bundle, 0, [0])
    before = sorted(bpy.data.objects.keys())
    for round_index, numbers, says in (
        (0, [2], "rollout 2 never began"),
        (0, [99], "no rollout 99"),
        (1, [0], "are missing"),
    ):
        with pytest.raises(SceneError, match=says):
            show_robot.show_rollouts(scene, bundle, round_index, numbers)
    assert sorted(bpy.data.objects.keys()) == before
    assert find_collection(scene, bundle.path, show_robot.PART) is not None
    shown = show_robot.show_rollouts(scene, bundle, 0, range(len(fake_rollouts.FRAMES)))
    assert len(shown) == sum(frames > 0 for frames in fake_rollouts.FRAMES)
