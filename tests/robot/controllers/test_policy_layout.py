"""Observation layouts: the shipped ones' sizes, what a small one says, and clear refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.controllers.policy_layout import PolicyLayout
from r2sego_blender.robot.scope.scope import shipped_layouts

SMALL = """
rate_hz = 50.0
step_s = 0.005
joints = [["left_knee_joint", 0.3, 150.0, 4.0], ["right_knee_joint", 0.2, 100.0, 2.0]]
held = [["waist_yaw_joint", 0.1, 200.0, 5.0]]
upper_body = [["right_knee_joint", 0.5]]
observation = [
  { term = "base_ang_vel", scale = 0.25, clip = 2.0 },
  { term = "joint_pos_rel", scale = [1.0, 2.0] },
  { term = "gait_phase", period_s = 0.8 },
  { term = "upper_body_reference" },
  { term = "last_action" },
]

[history]
length = 3
order = "per_step"
start = "zeros"

[action]
joints = ["right_knee_joint"]
scale = 0.5
clip = 10.0

[commands]
vx_m_s = [-0.5, 1.0]
vy_m_s = [-0.3, 0.3]
yaw_rate_rad_s = [-1.0, 1.0]
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "layout.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("name", "observations", "actions", "decimation"),
    [
        ("unitree_rl_lab_g1_29dof", 480, 29, 4),
        ("unitree_rl_gym_g1_12dof", 47, 12, 10),
        ("unitree_rl_gym_h1", 41, 10, 10),
        ("falcon_g1_29dof", 575, 29, 4),
    ],
)
def test_shipped_layouts_have_their_policies_sizes(name, observations, actions, decimation):
    layout = PolicyLayout.load(name)
    assert (layout.observation_size, layout.action_size, layout.decimation) == (observations, actions, decimation)
    for joint in (*layout.joints, *layout.held):
        assert joint.servo.stiffness > 0.0
        assert abs(joint.default_rad) < 1.0
    names = [joint.name for joint in (*layout.joints, *layout.held)]
    assert len(set(names)) == len(names)


def test_every_shipped_layout_is_tested():
    assert set(shipped_layouts()) == {
        "unitree_rl_lab_g1_29dof",
        "unitree_rl_gym_g1_12dof",
        "unitree_rl_gym_h1",
        "falcon_g1_29dof",
    }


def test_left_and_right_of_a_shipped_layout_are_mirrored():
    """Servos are the same on both sides; angles too, but for those about x and z."""
    for name in shipped_layouts():
        layout = PolicyLayout.load(name)
        joints = {joint.name: joint for joint in (*layout.joints, *layout.held)}
        for key, left in joints.items():
            if key.startswith("left_"):
                right = joints[key.replace("left_", "right_")]
                assert left.servo == right.servo
                sign = -1.0 if "roll" in key or "yaw" in key else 1.0
                assert left.default_rad == pytest.approx(sign * right.default_rad)


def test_a_small_layout_says_what_its_file_says(tmp_path):
    layout = PolicyLayout.load(written(tmp_path, SMALL))
    assert layout.observation_size == 3 * (3 + 2 + 2 + 1 + 1)
    np.testing.assert_array_equal(layout.actions, [1])
    np.testing.assert_array_equal(layout.action_scale, [0.5])
    np.testing.assert_array_equal(layout.default_rad, [0.3, 0.2])
    assert layout.action_clip == 10.0
    assert (layout.history, layout.history_order, layout.history_start) == (3, "per_step", "zeros")
    angular, positions, phase, *_ = layout.terms
    assert angular.clip == 2.0
    np.testing.assert_array_equal(positions.scale, [1.0, 2.0])
    assert phase.period_s == 0.8
    assert layout.commands.base_height_m is None
    assert layout.upper_body == (("right_knee_joint", 0.5),)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rate_hz = 50.0", "rate_h = 50.0", r"rate_h is not a field of this observation layout. Did you mean rate_hz"),
        ("rate_hz = 50.0", "", "rate_hz is missing"),
        ("rate_hz = 50.0", 'rate_hz = "50"', r"rate_hz is '50'"),
        ("rate_hz = 50.0", "rate_hz = nan", "rate_hz is nan"),
        ("step_s = 0.005", "step_s = 0.006", "step_s is 0.006. The policy's period is a whole number"),
        ("step_s = 0.005", "step_s = 1.0", r"step_s is 1.0. It lies from 0.0001 to 0.02"),
        ('["left_knee_joint", 0.3, 150.0, 4.0]', '["left_knee_joint", 0.3]', r"joints\[0\] is \['left_knee"),
        ('["left_knee_joint", 0.3, 150.0, 4.0]', '["right_knee_joint", 0.3, 1.0, 4.0]', "joints name right_knee"),
        ("0.3, 150.0", "0.3, -150.0", r"joints\[0\] is .*stiffness"),
        ("0.3, 150.0", "inf, 150.0", r"joints\[0\] is "),
        ('"base_ang_vel"', '"base_velocity"', r"observation\[0\].term is 'base_velocity'. Give one of: base_lin_vel"),
        ("scale = [1.0, 2.0]", "scale = [1.0]", r"observation\[1\].scale is \[1.0\].*a list of 2"),
        (", period_s = 0.8", "", r"observation\[2\].period_s is missing"),
        ('"last_action"', '"last_action", period_s = 1.0', r"observation\[4\].period_s is no field of this term"),
        ("upper_body = ", "upper_bodies = ", "upper_bodies is not a field"),
        ('[["right_knee_joint", 0.5]]', "[]", r"observation\[3\] is upper_body_reference of no joints"),
        ("length = 3", "length = 2.5", "history.length is 2.5"),
        ("length = 3", "length = 1000000", "history.length is 1000000"),
        ('"per_step"', '"newest_first"', "history.order is 'newest_first'"),
        ('joints = ["right_knee_joint"]', 'joints = ["hand"]', "action.joints are not all among the joints"),
        ("scale = 0.5", "", "action.scale is missing"),
        ("vx_m_s = [-0.5, 1.0]", "vx_m_s = [1.0, -0.5]", r"commands.vx_m_s is \[1.0, -0.5\]"),
        ("vx_m_s = [-0.5, 1.0]", "vx_m_s = [0.5, 1.0]", "commands.vx_m_s leaves out 0"),
        ("vx_m_s = [-0.5, 1.0]", "vx_m_s = [-0.5, 0.0]", "commands.vx_m_s is never positive"),
        ("[commands]", "[commands]\nbase_height_m = [0.5, 0.7]", "commands.base_height_m is not observed"),
        ("[history]", "[history", "is no TOML"),
    ],
)
def test_a_wrong_layout_names_its_file_and_field(tmp_path, old, new, message):
    assert old in SMALL
    path = written(tmp_path, SMALL.replace(old, new, 1))
    with pytest.raises(RobotError, match=message) as raised:
        PolicyLayout.load(path)
    assert str(raised.value).startswith(str(path))


def test_a_height_command_needs_its_ranges(tmp_path):
    text = SMALL.replace('{ term = "last_action" }', '{ term = "base_height_command" }')
    with pytest.raises(RobotError, match=r"commands.base_height_m is missing"):
        PolicyLayout.load(written(tmp_path, text))
    low = text + "base_height_m = [0.5, 0.7]\nwalking_height_m = 0.8\n"
    with pytest.raises(RobotError, match=r"commands.walking_height_m is 0.8. It lies from 0.5 to 0.7"):
        PolicyLayout.load(written(tmp_path, low))


def test_a_missing_layout_names_the_shipped_ones(tmp_path):
    with pytest.raises(
        RobotError, match=r"nowhere.toml: this observation layout \(controller.layout\) cannot be read. .*falcon_g1"
    ):
        PolicyLayout.load(tmp_path / "nowhere.toml")
