"""A policy's episode in Blender: the robot as it moved, and before its camera what its head saw."""

import fake_policy_evaluation
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

from r2sego_blender.bridge.robot import robot_playback  # noqa: E402
from r2sego_blender.bridge.robot.show_policy_episode import HEAD_IMAGE, show_policy_episode  # noqa: E402
from r2sego_blender.core.errors import SceneError  # noqa: E402
from r2sego_blender.results.panels.rollout_bodies import RobotBodies  # noqa: E402
from r2sego_blender.results.panels.rollout_list import POLICY, rollouts_folder  # noqa: E402
from r2sego_blender.results.policy_evaluation import head_pictures  # noqa: E402


@pytest.fixture(autouse=True)
def playback():
    """The timeline is followed, as while the add-on is enabled."""
    robot_playback.register()
    yield
    robot_playback.unregister()


def head_cameras(scene):
    return [one for one in scene.objects if one.type == "CAMERA"]


def test_robot_and_pictures_follow_the_timeline(scene, bundle):
    image = show_policy_episode(scene, bundle, 1)
    frames = fake_policy_evaluation.FRAMES[1]
    (camera,) = head_cameras(scene)
    (background,) = camera.data.background_images
    user = background.image_user
    files = head_pictures(bundle, 1, frames)
    assert background.image == image and image.source == "SEQUENCE"
    assert bpy.path.abspath(image.filepath) == str(files[0])
    # Frame f shows the file of f, which is numbered from 000.
    assert (user.frame_start + user.frame_offset + 1, user.frame_duration) == (0, frames)
    assert (scene.frame_start, scene.frame_end) == (0, frames - 1)
    bodies = RobotBodies.load(bundle, POLICY)
    for frame in (0, 3, 4, 1):
        scene.frame_set(frame)
        for index, name in enumerate(bodies.names):
            shown = np.array(scene.objects[f"Robot {name}, rollout 1"].matrix_world)
            np.testing.assert_allclose(shown, bodies.poses(1)[frame, index], atol=1e-5)


def test_another_episode_takes_its_place_and_one_without_pictures_shows_none(scene, bundle):
    assert show_policy_episode(scene, bundle, 0) is not None
    show_policy_episode(scene, bundle, 1, look_through=True)
    assert len(bpy.data.images) == 1 and scene.camera == head_cameras(scene)[0]
    assert show_policy_episode(scene, bundle, 2) is None
    assert HEAD_IMAGE not in bpy.data.images
    (camera,) = head_cameras(scene)
    assert not camera.data.background_images


def test_what_is_not_there_changes_nothing(scene, bundle):
    show_policy_episode(scene, bundle, 0)
    before = sorted(bpy.data.objects.keys())
    with pytest.raises(SceneError):
        show_policy_episode(scene, bundle, 7)
    assert sorted(bpy.data.objects.keys()) == before
    assert rollouts_folder(bundle, POLICY).is_dir()
