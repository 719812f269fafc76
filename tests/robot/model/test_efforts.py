"""How hard a robot's file lets its joints be driven, against what MuJoCo makes of its actuators."""

from __future__ import annotations

import re

import mujoco
import numpy as np
import pytest

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.robot.model.composition import compose
from r2sego_blender.robot.model.efforts import effort
from r2sego_blender.robot.model.humanoid import humanoid_mjcf
from r2sego_blender.robot.model.model import RobotModel

JOINT = "left_hip_pitch_joint"
# The tendons' ids are those of joints: 1 is the hip's.
TENDONS = "".join(f'<fixed name="finger {i}"><joint joint="left_wrist_yaw_joint" coef="1"/></fixed>' for i in range(2))
FINGERS = "".join(f'<position tendon="finger {i}" kp="5" forcerange="-1 1"/>' for i in range(2))


def robot_of(tmp_path, actuators: str, joint: str = "") -> RobotModel:
    """The embedded humanoid driven by ``actuators`` alone, with attributes ``joint`` of its left hip."""
    text = re.sub(r"<actuator>.*</actuator>", "", humanoid_mjcf(), flags=re.DOTALL)
    text = text.replace(f'<joint name="{JOINT}"', f'<joint name="{JOINT}" {joint}')
    driven = f"<tendon>{TENDONS}</tendon><actuator>{actuators}</actuator>"
    path = tmp_path / "robot.xml"
    path.write_text(text.replace("</mujoco>", f"{driven}</mujoco>"))
    return RobotModel.load(path)


@pytest.mark.parametrize(
    ("actuators", "joint", "most_nm"),
    [
        ("<position {j} kp='50' forcerange='-88 88'/>", "", 88.0),
        ("<position {j} kp='50' forcerange='-88 60'/>", "", 88.0),
        ("<position {j} kp='50' forcerange='-0.88 0.88' gear='100'/>", "", 88.0),
        ("<position {j} kp='50' forcerange='-88 88' gear='-1'/>", "", 88.0),
        ("<position jointinparent='left_hip_pitch_joint' kp='50' forcerange='-88 88'/>", "", 88.0),
        ("<motor {j} ctrlrange='-88 88'/>", "", 88.0),
        ("<motor {j} ctrlrange='-1 1' gear='88'/>", "", 88.0),
        ("<general {j} ctrlrange='-1 1' gainprm='4' gear='22'/>", "", 88.0),
        ("<motor {j} ctrlrange='-100 100' forcerange='-88 88'/>", "", 88.0),
        ("<motor {j} ctrlrange='-88 88'/>", "actuatorfrcrange='-120 120'", 88.0),
        ("<motor {j} ctrlrange='-120 120'/>", "actuatorfrcrange='-88 88'", 88.0),
        ("<motor {j} ctrlrange='0 1' gear='88'/><motor {j} ctrlrange='0 1' gear='-88'/>", "", 88.0),
        ("<motor {j} ctrlrange='-44 44'/><motor {j} ctrlrange='-44 44'/>", "", 88.0),
        (FINGERS, "actuatorfrcrange='-88 80'", 88.0),
    ],
)
def test_a_joint_is_driven_as_hard_as_its_file_says(tmp_path, box_room, actuators, joint, most_nm):
    """With every actuator driven to either end MuJoCo exerts as much, and no more."""
    robot = robot_of(tmp_path, actuators.format(j=f"joint='{JOINT}'"), joint)
    model, data = robot.model, mujoco.MjData(robot.model)
    at = model.joint(JOINT).id
    assert effort(model, at) == pytest.approx(most_nm)
    driving = [i for i in range(model.nu) if model.actuator_trntype[i] != mujoco.mjtTrn.mjTRN_TENDON]
    reached_nm = []
    for ends in np.ndindex(*(2,) * len(driving)):
        data.ctrl[driving] = 1e6 * (2.0 * np.array(ends) - 1.0)
        mujoco.mj_forward(model, data)
        reached_nm.append(abs(data.qfrc_actuator[model.jnt_dofadr[at]]))
    if driving:
        assert max(reached_nm) == pytest.approx(most_nm)
    composed = compose(robot, box_room(), RolloutSettings(), wrench=False).model
    np.testing.assert_allclose(composed.actuator(JOINT).forcerange, (-most_nm, most_nm))


@pytest.mark.parametrize(
    "actuators",
    [FINGERS, "<motor {j}/>", "<position {j} kp='50' ctrlrange='-1 1'/>", "<motor {j} ctrlrange='-1 1' gear='0'/>"],
)
def test_a_joint_that_nothing_bounds_has_no_effort(tmp_path, box_room, actuators):
    robot = robot_of(tmp_path, actuators.format(j=f"joint='{JOINT}'"))
    assert effort(robot.model, robot.model.joint(JOINT).id) == 0.0
    composed = compose(robot, box_room(), RolloutSettings(), wrench=False).model
    assert not composed.actuator_forcelimited[composed.actuator(JOINT).id]


@pytest.mark.parametrize("name", ["humanoid", "wheeled"])
def test_the_embedded_robots_are_as_strong_as_their_actuators(name, request):
    model = request.getfixturevalue(name).model
    for actuator in range(model.nu):
        assert effort(model, model.actuator_trnid[actuator, 0]) == model.actuator_forcerange[actuator, 1] > 0.0


def test_a_geared_servo_pulls_the_joint_as_mujoco_has_it(tmp_path):
    robot = robot_of(tmp_path, f"<position joint='{JOINT}' kp='3' kv='0.5' gear='7'/>")
    servo, model, data = robot.servos()[JOINT], robot.model, mujoco.MjData(robot.model)
    joint = model.joint(JOINT)
    data.qpos[joint.qposadr], data.qvel[joint.dofadr] = 0.2, -0.3
    mujoco.mj_forward(model, data)
    pull_nm = -servo.stiffness * 0.2 + servo.damping * 0.3
    assert data.qfrc_actuator[joint.dofadr] == pytest.approx(pull_nm)
