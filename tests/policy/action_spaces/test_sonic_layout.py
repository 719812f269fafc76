"""SONIC's layout, held against numbers written down by hand from its deployed code."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from r2sego_blender.policy.action_spaces import sonic_layout as layout
from r2sego_blender.robot.model.model import RobotModel

# isaaclab order in mujoco index, as the deployed code has it beside its inverse
MUJOCO_OF_ISAACLAB = [0, 6, 12, 1, 7, 13, 2, 8, 14, 3, 9, 15, 22, 4, 10, 16, 23, 5, 11, 17, 24, 18, 25, 19, 26, 20, 27]
MUJOCO_OF_ISAACLAB += [21, 28]
IN_ISAACLAB = ["left_hip_pitch", "right_hip_pitch", "waist_yaw", "left_hip_roll", "right_hip_roll", "waist_roll"]


def test_joints_are_those_of_the_robot_in_its_order():
    assert tuple(RobotModel.load().servos()) == layout.JOINTS


def test_the_orders_are_each_others_inverse():
    assert layout.MUJOCO_TO_ISAACLAB.tolist() == MUJOCO_OF_ISAACLAB
    assert [layout.JOINTS[i] for i in layout.MUJOCO_TO_ISAACLAB[:6]] == [f"{name}_joint" for name in IN_ISAACLAB]


# Published: kp = armature (20 pi)^2, kd = 4 armature 20 pi, a quarter of the effort by kp.
@pytest.mark.parametrize(
    ("joint", "stiffness", "damping", "scale", "default"),
    [
        ("left_hip_pitch", 99.0984277, 6.3088018, 0.3506615, -0.312),
        ("right_hip_roll", 99.0984277, 6.3088018, 0.3506615, 0.0),
        ("left_hip_yaw", 40.1792385, 2.5578898, 0.5475465, 0.0),
        ("right_knee", 99.0984277, 6.3088018, 0.3506615, 0.669),
        ("left_ankle_pitch", 28.5012462, 1.8144457, 0.4385773, -0.363),
        ("right_ankle_roll", 28.5012462, 1.8144457, 0.4385773, 0.0),
        ("waist_yaw", 40.1792385, 2.5578898, 0.5475465, 0.0),
        ("waist_pitch", 28.5012462, 1.8144457, 0.4385773, 0.0),
        ("right_shoulder_roll", 14.2506231, 0.9072228, 0.4385773, -0.2),
        ("left_shoulder_roll", 14.2506231, 0.9072228, 0.4385773, 0.2),
        ("left_elbow", 14.2506231, 0.9072228, 0.4385773, 0.6),
        ("right_wrist_roll", 14.2506231, 0.9072228, 0.4385773, 0.0),
        ("left_wrist_pitch", 16.7783275, 1.0681415, 0.0745009, 0.0),
    ],
)
def test_gains_scales_and_defaults(joint, stiffness, damping, scale, default):
    index, servo = layout.JOINTS.index(f"{joint}_joint"), layout.SERVOS[f"{joint}_joint"]
    assert (servo.stiffness, servo.damping) == pytest.approx((stiffness, damping), rel=1e-6)
    assert layout.ACTION_SCALE[index] == pytest.approx(scale, rel=1e-6)
    assert layout.DEFAULT_RAD[index] == default


def test_an_action_moves_the_joint_that_isaaclab_calls_by_its_place():
    for isaaclab, mujoco in enumerate(MUJOCO_OF_ISAACLAB):
        action = np.zeros(29, np.float32)
        action[isaaclab] = 1.0
        moved = layout.targets_of(action) - layout.DEFAULT_RAD
        assert np.flatnonzero(moved).tolist() == [mujoco]
        assert moved[mujoco] == pytest.approx(layout.ACTION_SCALE[mujoco])


def test_the_decoder_is_told_ten_frames_oldest_first_by_kind():
    observer, token = layout.DecoderObservation(), np.arange(64) / 64.0
    for t in range(12):
        frame = layout.ProprioceptiveFrame(
            angular_velocity=np.array([t, t + 0.1, t + 0.2]),
            gravity=np.array([t, 0.0, -1.0]),
            joint_positions=layout.DEFAULT_RAD + np.arange(29) + 100 * t,
            joint_velocities=1000.0 * np.arange(29) + t,
            action=np.arange(29) - 50.0 * t,
        )
        seen = observer.observe(frame, token)
    assert seen.shape == (994,) and seen.dtype == np.float32
    assert np.array_equal(seen[:64], token.astype(np.float32))
    assert np.allclose(seen[64:67], [2.0, 2.1, 2.2]) and np.allclose(seen[91:94], [11.0, 11.1, 11.2])
    assert np.allclose(seen[94:123], np.array(MUJOCO_OF_ISAACLAB) + 200)  # relative, in IsaacLab's order
    assert np.allclose(seen[355:384], np.array(MUJOCO_OF_ISAACLAB) + 1100)
    assert np.allclose(seen[384:413], 1000.0 * np.array(MUJOCO_OF_ISAACLAB) + 2)
    assert np.allclose(seen[674:703], np.arange(29) - 100.0)  # raw, as the network gave it
    assert np.allclose(seen[964:967], [2.0, 0.0, -1.0]) and np.allclose(seen[991:994], [11.0, 0.0, -1.0])


def test_before_there_are_ten_frames_the_first_is_repeated():
    observer = layout.DecoderObservation()
    for t in (5.0, 6.0):
        frame = layout.ProprioceptiveFrame(np.full(3, t), np.full(3, t), np.zeros(29), np.zeros(29), np.zeros(29))
        seen = observer.observe(frame, np.zeros(64))
    assert seen[64:94].reshape(10, 3)[:, 0].tolist() == [5.0] * 9 + [6.0]


def test_the_encoder_is_told_the_motion_ahead():
    frames = np.arange(10)[:, None]
    positions, velocities = np.arange(29) + 100.0 * frames, -np.arange(29) - 1000.0 * frames
    base = Rotation.from_euler("z", 0.3)
    reference = Rotation.from_euler("z", (0.3 + 0.1 * np.arange(10))[:, None])
    quaternions = np.roll(reference.as_quat(), 1, axis=1)
    seen = layout.encoder_observation(positions, velocities, np.roll(base.as_quat(), 1), quaternions)
    assert seen.shape == (1762,) and seen.dtype == np.float32
    assert not seen[:4].any() and not seen[584:601].any() and not seen[661:].any()
    assert np.allclose(seen[4:33], MUJOCO_OF_ISAACLAB) and np.allclose(
        seen[265:294], np.array(MUJOCO_OF_ISAACLAB) + 900
    )
    assert np.allclose(seen[294:323], -np.array(MUJOCO_OF_ISAACLAB))
    turned = 0.1 * 7  # the eighth frame, as the robot sees it
    columns = [math.cos(turned), -math.sin(turned), math.sin(turned), math.cos(turned), 0.0, 0.0]
    assert np.allclose(seen[601 + 42 : 601 + 48], columns, atol=1e-6)
