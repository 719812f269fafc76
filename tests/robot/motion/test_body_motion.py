"""Recorded bodies tell the order of joints without names, and where the base is."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.motion.body_motion import joint_orders
from r2sego_blender.robot.motion.recorded_motion import read_recording, robot_motion


def turning(robot: RobotModel, frames: int = 61) -> np.ndarray:
    """(T, nq) the robot drifts 0.3 m, turns by 60 degrees and moves its arms."""
    qpos = np.tile(robot.rest_qpos, (frames, 1))
    phase = np.linspace(0.0, 1.0, frames)
    qpos[:, 1] += 0.3 * phase
    qpos[:, 3:7] = Rotation.from_euler("z", np.radians(60.0) * phase[:, None]).as_quat(scalar_first=True)
    for sign, shoulder in zip((1.0, -1.0), robot.shoulders, strict=False):
        qpos[:, robot.model.jnt_qposadr[shoulder]] -= 0.5 * sign * phase
    return qpos


def bodies_of(robot: RobotModel, qpos: np.ndarray, chosen: list[int]) -> dict[str, np.ndarray]:
    """(T, B, 3) and (T, B, 4) wxyz of the bodies, as whole_body_tracking's files have them."""
    data = mujoco.MjData(robot.model)
    places, turns = np.empty((len(qpos), len(chosen), 3)), np.empty((len(qpos), len(chosen), 4))
    for frame, configuration in enumerate(qpos):
        data.qpos[:] = configuration
        mujoco.mj_kinematics(robot.model, data)
        places[frame], turns[frame] = data.xpos[chosen], data.xquat[chosen]
    return {"body_pos_w": places, "body_quat_w": turns}


def columns(robot: RobotModel, names: tuple[str, ...], qpos: np.ndarray) -> np.ndarray:
    return qpos[:, [robot.model.joint(name).qposadr[0] for name in names]]


def played(path: Path, robot: RobotModel) -> np.ndarray:
    return robot_motion(read_recording(path), robot)


def test_isaac_lab_s_order_is_breadth_first(humanoid):
    own, breadth_first = joint_orders(humanoid)
    assert own[:4] == ("left_hip_pitch_joint", "left_hip_roll_joint", "left_hip_yaw_joint", "left_knee_joint")
    assert breadth_first[:6] == (
        *("left_hip_pitch_joint", "right_hip_pitch_joint", "waist_yaw_joint"),
        *("left_hip_roll_joint", "right_hip_roll_joint", "waist_roll_joint"),
    )
    assert sorted(own) == sorted(breadth_first)


@pytest.mark.parametrize("which", [0, 1], ids=["depth first", "breadth first"])
@pytest.mark.parametrize("bodies", ["all", "some"])
@pytest.mark.parametrize("scalar_first", [True, False])
def test_the_motion_is_the_reference_s_in_either_order(humanoid, tmp_path, which, bodies, scalar_first):
    qpos = turning(humanoid)
    count = humanoid.model.nbody
    chosen = list(range(1, count)) if bodies == "all" else [1, *range(4, count, 3)]
    recorded = bodies_of(humanoid, qpos, chosen)
    if not scalar_first:
        recorded["body_quat_w"] = recorded["body_quat_w"][..., [1, 2, 3, 0]]
    joints = columns(humanoid, joint_orders(humanoid)[which], qpos)
    np.savez(tmp_path / "m.npz", fps=np.array([50]), joint_pos=joints, joint_vel=0.0 * joints, **recorded)
    np.savez(tmp_path / "r.npz", fps=50, qpos=qpos)
    np.testing.assert_allclose(played(tmp_path / "m.npz", humanoid), played(tmp_path / "r.npz", humanoid), atol=2e-4)


def test_names_find_the_base_wherever_it_stands(humanoid, tmp_path):
    qpos = turning(humanoid)
    chosen = [5, 9, humanoid.base, 20]
    names = [humanoid.model.body(body).name for body in chosen]
    own = joint_orders(humanoid)[0]
    recorded = bodies_of(humanoid, qpos, chosen)
    isaac = {"body_positions": recorded["body_pos_w"], "body_rotations": recorded["body_quat_w"], "body_names": names}
    np.savez(tmp_path / "m.npz", fps=50, dof_names=own, dof_positions=columns(humanoid, own, qpos), **isaac)
    np.savez(tmp_path / "r.npz", fps=50, qpos=qpos)
    np.testing.assert_allclose(played(tmp_path / "m.npz", humanoid), played(tmp_path / "r.npz", humanoid), atol=2e-4)


def test_a_base_of_its_own_stands_before_a_body_s(humanoid, tmp_path):
    qpos = turning(humanoid)
    own = joint_orders(humanoid)[0]
    recorded = bodies_of(humanoid, qpos, [1, 5]) | {"root_pos": qpos[:, :3], "root_quat": qpos[:, 3:7]}
    recorded["body_pos_w"] = recorded["body_pos_w"] + [5.0, 0.0, 0.0]
    np.savez(tmp_path / "m.npz", fps=50, joint_names=own, joint_pos=columns(humanoid, own, qpos), **recorded)
    np.testing.assert_allclose(played(tmp_path / "m.npz", humanoid)[:, :2], qpos[:, :2], atol=1e-6)


def test_what_the_bodies_do_not_tell_is_asked_for(humanoid, tmp_path):
    qpos = turning(humanoid)
    joints = columns(humanoid, joint_orders(humanoid)[1], qpos)
    np.savez(tmp_path / "m.npz", fps=50, joint_pos=joints, **bodies_of(humanoid, qpos, [1]))
    with pytest.raises(RobotError, match=r"do not tell their order. Say the order: name the joints in joint_names"):
        played(tmp_path / "m.npz", humanoid)
    recorded = bodies_of(humanoid, qpos, list(range(1, humanoid.model.nbody)))
    np.savez(tmp_path / "m.npz", fps=50, joint_pos=joints, body_pos_w=recorded["body_pos_w"])
    with pytest.raises(RobotError, match="without rotations"):
        read_recording(tmp_path / "m.npz")
    recorded["body_pos_w"] = recorded["body_pos_w"] * 1.5
    np.savez(tmp_path / "m.npz", fps=50, joint_pos=joints, **recorded)
    with pytest.raises(RobotError, match="from where its joints have the robot's"):
        played(tmp_path / "m.npz", humanoid)


@pytest.mark.parametrize(
    ("shape", "turns"), [((3, 2, 3), (3, 2, 3)), ((3, 0, 3), (3, 0, 4)), ((2, 2, 3), (2, 2, 4)), ((3, 2, 3), (3, 1, 4))]
)
def test_bodies_that_do_not_belong_together_are_refused(tmp_path, shape, turns):
    np.savez(tmp_path / "m.npz", joint_pos=np.zeros((3, 29)), body_pos_w=np.zeros(shape), body_quat_w=np.ones(turns))
    with pytest.raises(RobotError, match="do not belong together"):
        read_recording(tmp_path / "m.npz")
