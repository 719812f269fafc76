"""A human's motion on a robot: limbs point alike, feet stay where they stand, limits are kept."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.behaviours.trajectory import RATE_HZ
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.motion.foot_locking import foot_places, spans
from r2sego_blender.robot.motion.recorded_motion import HUMAN_BODIES, HumanRecording, read_recording
from r2sego_blender.robot.motion.retargeting import retarget, segments, standing

G1 = "g1/unitree_mujoco_g1/g1_29dof.xml"
G1_MOUNT = ["torso_link", [0.0576235, 0.01753, 0.42987], [0.0, 0.8307767, 0.0], {"hfov_deg": 69.0}]
H1_MOUNT = ["pelvis", [0.10848, 0.0325, 0.69317], [0.0, 0.8, 0.0], {"hfov_deg": 69.0}]
SIT = "g1/motions/smpl_humanoid_sit_armchair.motion"
_THIGH_M, _SHIN_M, _UPPER_ARM_M, _FOREARM_M = 0.4, 0.4, 0.28, 0.25


def squatting_human(frames: int = 60, deepest_rad: float = 1.0, turn_rad: float = 0.6) -> HumanRecording:
    """A human who bends the knees by up to ``2 * deepest_rad`` with both feet planted, the arms
    hanging and then lifted forward; facing ``turn_rad``."""
    index = {name: body for body, name in enumerate(HUMAN_BODIES)}
    position = np.zeros((frames, 24, 3))
    bend = deepest_rad * np.sin(np.linspace(0.0, math.pi, frames)) ** 2
    forward = np.array([1.0, 0.0, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    for side, y in (("left", 0.1), ("right", -0.1)):
        ankle = np.array([0.0, y, 0.08])
        shin = _SHIN_M * (np.sin(bend)[:, None] * forward + np.cos(bend)[:, None] * up)
        thigh = _THIGH_M * (-np.sin(bend)[:, None] * forward + np.cos(bend)[:, None] * up)
        knee = ankle + shin
        position[:, index[f"{side}_ankle"]] = ankle
        position[:, index[f"{side}_toe"]] = ankle + 0.12 * forward
        position[:, index[f"{side}_knee"]] = knee
        position[:, index[f"{side}_hip"]] = knee + thigh
    pelvis = position[:, [index["left_hip"], index["right_hip"]]].mean(axis=1) + 0.05 * up
    position[:, 0] = pelvis
    for height, name in ((0.1, "torso"), (0.2, "spine"), (0.3, "chest"), (0.5, "neck"), (0.6, "head")):
        position[:, index[name]] = pelvis + height * up
    lift = 0.2 + bend  # the arms hang a little forward, so that their elbows have a side
    for side, y in (("left", 0.2), ("right", -0.2)):
        shoulder = pelvis + 0.45 * up + [0.0, y, 0.0]
        arm = np.sin(lift)[:, None] * forward - np.cos(lift)[:, None] * up
        fore = np.sin(lift + 0.6)[:, None] * forward - np.cos(lift + 0.6)[:, None] * up
        position[:, index[f"{side}_thorax"]] = position[:, index[f"{side}_shoulder"]] = shoulder
        position[:, index[f"{side}_elbow"]] = shoulder + _UPPER_ARM_M * arm
        position[:, index[f"{side}_wrist"]] = shoulder + _UPPER_ARM_M * arm + _FOREARM_M * fore
        position[:, index[f"{side}_hand"]] = position[:, index[f"{side}_wrist"]]
    turn = Rotation.from_euler("z", turn_rad).as_matrix()
    rotation = np.broadcast_to(turn, (frames, 24, 3, 3)).copy()
    return HumanRecording("a human", RATE_HZ, position @ turn.T + [3.0, -2.0, 0.0], rotation)


def errors_deg(robot: RobotModel, qpos: np.ndarray, human: HumanRecording) -> dict[str, np.ndarray]:
    """Angles between the robot's limbs and the human's, at the human's frames."""
    model, data = robot.model, mujoco.MjData(robot.model)
    found: dict[str, list[float]] = {part.name: [] for part in segments(robot)}
    for frame, positions in enumerate(human.position_m):
        at = frame / human.rate_hz * RATE_HZ
        if at != int(at) or at >= len(qpos):
            continue
        data.qpos[:] = qpos[int(at)]
        mujoco.mj_kinematics(model, data)
        for part in segments(robot):
            limb = data.body(part.body).xmat.reshape(3, 3) @ part.axis
            bone = positions[part.human_to] - positions[part.human_from]
            cosine = limb @ bone / np.linalg.norm(limb) / np.linalg.norm(bone)
            found[part.name].append(math.degrees(math.acos(np.clip(cosine, -1.0, 1.0))))
    return {name: np.array(angles) for name, angles in found.items()}


def assert_limits_and_floor(robot: RobotModel, qpos: np.ndarray) -> None:
    limited = robot.model.jnt_limited.astype(bool)
    angles = qpos[:, robot.model.jnt_qposadr[limited]]
    assert (angles >= robot.model.jnt_range[limited, 0] - 1e-6).all()
    assert (angles <= robot.model.jnt_range[limited, 1] + 1e-6).all()
    heights = foot_places(robot, qpos)[1]
    assert heights.min() > -0.01
    assert heights.min(axis=0).max() < 0.06


@pytest.fixture(scope="module")
def squat(humanoid) -> np.ndarray:
    return retarget(squatting_human(), humanoid)


def test_a_squat_s_limbs_point_as_the_human_s(humanoid, squat):
    found = errors_deg(humanoid, squat, squatting_human())
    assert set(found) == {
        f"{side} {part}" for side in ("left", "right") for part in ("thigh", "shin", "upper arm", "forearm")
    }
    for name, angles in found.items():
        assert np.median(angles) < 6.0, name
        assert angles.max() < 12.0, name
    assert_limits_and_floor(humanoid, squat)


def test_a_squat_goes_down_by_the_legs_share_and_faces_as_the_human_does(humanoid, squat):
    human = squatting_human()
    legs_m = humanoid.rest_height_m - 0.03
    dropped = 1.0 - human.position_m[:, 0, 2].min() / human.position_m[:, 0, 2].max()
    assert 1.0 - squat[:, 2].min() / squat[:, 2].max() == pytest.approx(dropped, abs=0.08)
    assert squat[0, 2] == pytest.approx(legs_m, abs=0.05)
    yaw = Rotation.from_quat(squat[:, 3:7], scalar_first=True).as_euler("zyx")[:, 0]
    np.testing.assert_allclose(yaw, 0.6, atol=0.05)


def test_planted_feet_do_not_slide(humanoid, squat):
    places, heights = foot_places(humanoid, squat)
    assert np.linalg.norm(np.ptp(places[..., :2], axis=1), axis=1).max() < 0.003
    assert np.abs(heights).max() < 0.003


def test_another_scale_of_human_gives_the_same_robot(humanoid, squat):
    human = squatting_human()
    tall = HumanRecording("a giant", human.rate_hz, 1.7 * human.position_m, human.rotation)
    np.testing.assert_allclose(retarget(tall, humanoid), squat, atol=2e-2)


def test_a_human_elsewhere_turned_gives_the_same_joints(humanoid, squat):
    other = retarget(squatting_human(turn_rad=-2.0), humanoid)
    np.testing.assert_allclose(other[:, 7:], squat[:, 7:], atol=1e-2)
    np.testing.assert_allclose(other[:, 2], squat[:, 2], atol=2e-3)


@pytest.mark.parametrize(("start", "end"), [("left_knee", "left_ankle"), ("right_shoulder", "right_elbow")])
def test_limbs_without_a_length_are_refused(humanoid, start, end):
    human = squatting_human(frames=10)
    human.position_m[4, HUMAN_BODIES.index(end)] = human.position_m[4, HUMAN_BODIES.index(start)]
    with pytest.raises(RobotError, match=f"a human: {start} and {end} are in one place"):
        retarget(human, humanoid)


def test_a_human_needs_two_legs_with_knees(quadruped):
    with pytest.raises(RobotError, match=r"a human: the robot has 4 legs. A human's motion needs two"):
        retarget(squatting_human(), quadruped)


@pytest.mark.parametrize(("file", "mount"), [(G1, G1_MOUNT), ("h1/h1/h1.xml", H1_MOUNT)])
def test_the_sitting_human_on_real_robots(file, mount, shared_robot):
    robot = RobotModel.load(shared_robot(file), mount)
    human = read_recording(shared_robot(SIT))
    found = retarget(human, robot)
    assert len(found) == math.floor(781 / 30 * RATE_HZ) + 1
    assert np.isfinite(found).all()
    for name, angles in errors_deg(robot, found, human).items():
        assert np.median(angles) < 6.0, name
        assert np.quantile(angles, 0.95) < 13.0, name
    assert_limits_and_floor(robot, found)
    seated = found[round(450 / 30 * RATE_HZ)]
    assert 0.5 < seated[2] / robot.rest_height_m < 0.7
    assert np.abs(np.diff(found[:, 7:], axis=0)).max() * RATE_HZ < 12.0
    times = np.arange(len(found)) / RATE_HZ * human.rate_hz
    places, _ = foot_places(robot, found)
    for side, place in zip(("left", "right"), places, strict=True):
        ankle = human.position_m[:, HUMAN_BODIES.index(f"{side}_ankle")]
        at = np.stack([np.interp(times, np.arange(len(ankle)), column) for column in ankle.T], axis=1)
        stances = spans(standing(at))
        assert len(stances) > 8
        for begin, end in stances:
            assert np.linalg.norm(place[begin:end, :2] - place[begin, :2], axis=1).max() < 0.03
