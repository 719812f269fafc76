"""Robots of any file: structure, the mount's conventions, clear errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.errors import RobotError
from r2sego_blender.robot.model import RobotModel
from r2sego_blender.robot.mount import parse_mount

PUBLISHED_MOUNT = ["torso_link", [0.0576235, 0.01753, 0.42987], [0.0, 0.8307767, 0.0], {"hfov_deg": 69.0}]


def published_camera_in_torso() -> np.ndarray:
    """The mount written out by hand, OpenCV axes as columns."""
    sin, cos = math.sin(0.8307767), math.cos(0.8307767)
    pose = np.eye(4)
    pose[:3, 0] = (0.0, -1.0, 0.0)
    pose[:3, 1] = (-sin, 0.0, -cos)
    pose[:3, 2] = (cos, 0.0, -sin)
    pose[:3, 3] = (0.0576235, 0.01753, 0.42987)
    return pose


def test_embedded_mount_is_the_published_one(humanoid):
    assert humanoid.mount.parent == "torso_link"
    np.testing.assert_allclose(humanoid.mount.parent_from_camera, published_camera_in_torso(), atol=1e-6)
    by_hand = parse_mount(PUBLISHED_MOUNT, "test")
    np.testing.assert_allclose(by_hand.parent_from_camera, published_camera_in_torso(), atol=1e-12)


def test_camera_stands_in_the_world_as_opencv(humanoid):
    camera = humanoid.camera(640, 480)
    pelvis_to_torso = np.array([-0.0039635, 0.0, 0.785 + 0.035 + 0.019])
    np.testing.assert_allclose(camera.centre, pelvis_to_torso + PUBLISHED_MOUNT[1], atol=1e-5)
    ahead_on_floor = camera.centre + camera.forward * camera.centre[2] / -camera.forward[2]
    assert ahead_on_floor[0] > 0.5
    assert ahead_on_floor[2] == pytest.approx(0.0, abs=1e-9)
    pixel, depth = camera.project(ahead_on_floor)
    np.testing.assert_allclose(pixel, (320.0, 240.0), atol=1e-6)
    assert depth > 1.0
    higher, left = camera.project(ahead_on_floor + np.array([[0.0, 0.0, 0.1], [0.0, 0.1, 0.0]]))[0]
    assert higher[1] < 240.0
    assert left[0] < 320.0


def test_field_of_view_is_69_degrees_across_the_vga_image(humanoid):
    expected = 320.0 / math.tan(math.radians(34.5))
    assert humanoid.camera(640, 480).fx == pytest.approx(expected, rel=1e-6)
    assert parse_mount(PUBLISHED_MOUNT, "test").camera(640, 480).fx == pytest.approx(expected, rel=1e-12)


@given(st.floats(-30.0, 89.0))
def test_pitched_mount_looks_that_far_down_and_keeps_its_place(down_deg):
    mount = parse_mount(PUBLISHED_MOUNT, "test").pitched(down_deg)
    assert mount.pitch_down_deg == pytest.approx(down_deg, abs=1e-6)
    np.testing.assert_allclose(mount.parent_from_camera[:3, 0], (0.0, -1.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(mount.parent_from_camera[:3, 3], PUBLISHED_MOUNT[1])


def test_camera_follows_the_base_rigidly(humanoid):
    turned = humanoid.rest_qpos.copy()
    turned[:3] += (1.0, 2.0, 0.0)
    turned[3:7] = (math.cos(0.5), 0.0, 0.0, math.sin(0.5))
    rest, moved = humanoid.camera_poses(np.stack([humanoid.rest_qpos, turned]))
    motion = np.eye(4)
    motion[:2, :2] = [[math.cos(1.0), -math.sin(1.0)], [math.sin(1.0), math.cos(1.0)]]
    motion[:2, 3] = (1.0, 2.0)
    np.testing.assert_allclose(moved, motion @ rest, atol=1e-12)


def names(robot: RobotModel, joints) -> list[str]:
    return [robot.model.joint(joint).name for joint in joints]


def test_structure_of_the_embedded_humanoid(humanoid):
    assert names(humanoid, [humanoid.waist_yaw, humanoid.waist_pitch]) == [
        "waist_yaw_joint", "waist_pitch_joint",
    ]  # fmt: skip
    assert names(humanoid, humanoid.shoulders) == ["left_shoulder_pitch_joint", "right_shoulder_pitch_joint"]
    left, right = humanoid.legs
    assert [len(left.joints), len(right.joints)] == [6, 6]
    assert humanoid.model.body(left.foot).name == "left_ankle_roll_link"
    assert humanoid.rest_height_m == pytest.approx(0.785, abs=1e-5)
    assert left.sole_m == pytest.approx(0.035, abs=1e-5)
    assert 0.2 < humanoid.radius_m < 0.4
    assert humanoid.servos()["left_knee_joint"].stiffness == 150.0


def test_real_g1_loads_with_the_mount(humanoid, shared_robot):
    path = shared_robot("g1/unitree_mujoco_g1/g1_29dof.xml")
    robot = RobotModel.load(path, PUBLISHED_MOUNT)
    assert robot.model.nu == 29
    posture = humanoid.rest_qpos[None]
    np.testing.assert_allclose(robot.camera_poses(posture), humanoid.camera_poses(posture), atol=2e-4)
    assert robot.servos()["waist_yaw_joint"].stiffness == pytest.approx(200.0, rel=0.01)
    with pytest.raises(RobotError, match=r"does not say which camera.*Give the mount"):
        RobotModel.load(path)


@pytest.mark.parametrize("file", ["h1/h1/h1.xml", "h1/h1/urdf/h1.urdf"])
def test_h1_loads_from_mjcf_and_urdf(shared_robot, file):
    mount = ["pelvis", [0.10848, 0.0325, 0.69317], [0.0, 0.8, 0.0], {"hfov_deg": 69.0}]
    robot = RobotModel.load(shared_robot(file), mount)
    assert [len(leg.joints) for leg in robot.legs] == [5, 5]
    assert robot.waist_yaw is None
    assert robot.rest_height_m == pytest.approx(1.04, abs=0.02)
    assert robot.camera(640, 480).centre[2] == pytest.approx(robot.rest_height_m + 0.69317, abs=1e-6)


def write(tmp_path, text: str) -> str:
    path = tmp_path / "robot.xml"
    path.write_text(text)
    return str(path)


def test_file_that_does_not_compile_says_what_mujoco_says(tmp_path):
    path = write(tmp_path, '<mujoco><worldbody><body><geom typ="box"/></body></worldbody></mujoco>')
    with pytest.raises(RobotError, match=r"robot\.xml: the robot does not compile: .*typ.* Correct"):
        RobotModel.load(path)
    path = write(tmp_path, "<mujoco><worldbody><body><freejoint/></body></worldbody></mujoco>")
    with pytest.raises(RobotError, match="mass and inertia"):
        RobotModel.load(path)


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ('<body><geom size="1"/></body>', "0 free bodies"),
        (
            '<body name="a"><freejoint/><geom size="1"/><camera name="eye"/></body>',
            "0 legs and 0 driven wheels",
        ),
        ('<body><freejoint/><geom size="1"/><camera name="l"/><camera name="r"/></body>', "which camera"),
    ],
)
def test_robot_without_the_needed_parts(tmp_path, body, says):
    with pytest.raises(RobotError, match=says):
        RobotModel.load(write(tmp_path, f"<mujoco><worldbody>{body}</worldbody></mujoco>"))


def test_missing_file_and_unknown_names():
    with pytest.raises(RobotError, match="no such robot file"):
        RobotModel.load("nowhere.xml")
    with pytest.raises(RobotError, match=r"no camera 'eye'\. It has: head_camera"):
        RobotModel.load(mount="eye")
    with pytest.raises(RobotError, match=r"no body 'head'\. It has: pelvis"):
        RobotModel.load(mount=["head", [0, 0, 0], [0, 0, 0], 60])


@pytest.mark.parametrize(
    ("mount", "says"),
    [
        (["torso_link", [0, 0], [0, 0, 0], 60], "xyz"),
        (["torso_link", [0, 0, 0], [0, float("nan"), 0], 60], "rpy"),
        (["torso_link", [0, 0, 0], [0, 0, 0], 500], "fovy_deg"),
        (["torso_link", [0, 0, 0], [0, 0, 0], {"fov": 60}], "field of view"),
        ({"parent": "torso_link", "xyz": [0, 0, 0], "rpy": [0, 0, 0], "hfov": 60}, "'hfov'"),
        (["torso_link"], "four values"),
    ],
)
def test_malformed_mount_names_its_field(mount, says):
    with pytest.raises(RobotError, match=says):
        RobotModel.load(mount=mount)
