"""Motions in the layouts of other programs: nothing that says the base's pose or the rate is passed over."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.behaviours.trajectory import RATE_HZ
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.motion.recorded_motion import RobotRecording, read_recording, robot_motion

FRAMES = 91


@pytest.fixture(scope="module")
def turning() -> np.ndarray:
    """(T, 36) the humanoid drifts 0.4 m, turns by 70 degrees and lowers its left arm, in 1.5 s at 60 Hz."""
    robot = RobotModel.load()
    qpos = np.tile(robot.rest_qpos, (FRAMES, 1))
    phase = np.linspace(0.0, 1.0, FRAMES)
    qpos[:, 0] += 0.4 * phase
    qpos[:, 3:7] = Rotation.from_euler("z", np.radians(70.0) * phase[:, None]).as_quat(scalar_first=True)
    qpos[:, robot.model.joint("left_shoulder_pitch_joint").qposadr[0]] -= 0.5 * phase
    return qpos


def root_path_and_turn(path: Path, robot: RobotModel) -> tuple[np.ndarray, np.ndarray]:
    """(T, 2) and (T,) of a file as it is played: the way over the floor from its start, metres, and the turn, rad."""
    qpos = robot_motion(read_recording(path), robot)
    yaw = np.unwrap(Rotation.from_quat(qpos[:, 3:7], scalar_first=True).as_euler("zyx")[:, 0])
    return qpos[:, :2] - qpos[0, :2], yaw - yaw[0]


def saved(path: Path, **arrays) -> Path:
    if path.suffix == ".npz":
        np.savez(path, **arrays)
    else:
        torch.save({name: _tensor(value) for name, value in arrays.items()}, path)
    return path


def _tensor(value):
    return torch.from_numpy(value) if isinstance(value, np.ndarray) and value.dtype.kind == "f" else value


def gmr(qpos: np.ndarray) -> dict[str, np.ndarray]:
    return {"root_pos": qpos[:, :3], "root_rot": qpos[:, [4, 5, 6, 3]], "dof_pos": qpos[:, 7:]}


def phc(qpos: np.ndarray) -> dict[str, np.ndarray]:
    return {"root_trans_offset": qpos[:, :3], "root_rot": qpos[:, [4, 5, 6, 3]], "dof": qpos[:, 7:]}


def named_order(qpos: np.ndarray) -> dict[str, np.ndarray]:
    return {"root_pos": qpos[:, :3], "base_quat": qpos[:, 3:7], "joint_pos": qpos[:, 7:], "quaternion_order": "wxyz"}


@pytest.mark.parametrize("layout", [gmr, phc, named_order])
@pytest.mark.parametrize("suffix", [".npz", ".pt"])
def test_the_base_moves_as_in_the_reference_under_any_program_s_names(humanoid, tmp_path, turning, layout, suffix):
    reference = saved(tmp_path / "reference.npz", qpos=turning, rate_hz=60.0)
    motion = saved(tmp_path / f"m{suffix}", fps=60, **layout(turning))
    way, turn = root_path_and_turn(motion, humanoid)
    same_way, same_turn = root_path_and_turn(reference, humanoid)
    np.testing.assert_allclose(way, same_way, atol=1e-5)
    np.testing.assert_allclose(turn, same_turn, atol=1e-5)
    assert np.degrees(turn[-1]) == pytest.approx(70.0, abs=0.5)
    assert np.linalg.norm(way[-1]) == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize(
    ("name", "turns"),
    [
        ("attitude", lambda turn: turn.as_quat()),
        ("q", lambda turn: turn.as_quat(scalar_first=True)),
        ("matrices", lambda turn: turn.as_matrix()),
        ("root_r6", lambda turn: turn.as_matrix()[:, :, :2].reshape(-1, 6)),
        ("root_rotation", lambda turn: turn.as_rotvec()),
        ("orientation", lambda turn: turn.as_rotvec()),
        ("world_from_base", lambda turn: turn.as_rotvec()),
    ],
)
def test_a_rotation_that_is_not_known_is_refused_by_its_name(tmp_path, turning, name, turns):
    """By its numbers, or by what it is called."""
    values = turns(Rotation.from_quat(turning[:, 3:7], scalar_first=True))
    arrays = {"root_pos": turning[:, :3], "dof_pos": turning[:, 7:], name: values, "fps": 60}
    with pytest.raises(RobotError, match=rf"m\.npz: {name} .*(rotation|shape)"):
        read_recording(saved(tmp_path / "m.npz", **arrays))
    found = read_recording(saved(tmp_path / "m.npz", **arrays, root_quat=turning[:, [4, 5, 6, 3]]))
    assert found.unread == (name,) and found.quaternion is not None


def test_a_place_that_is_not_known_is_refused_by_its_name(tmp_path, turning):
    arrays = {"root_quat": turning[:, 3:7], "dof_pos": turning[:, 7:], "com_trans": turning[:, :3]}
    with pytest.raises(RobotError, match=r"com_trans .*place"):
        read_recording(saved(tmp_path / "m.npz", **arrays))


def test_objects_beside_the_arrays_are_passed_over_unless_they_may_be_the_base(tmp_path, turning):
    arrays = {"qpos": turning, "frequency": 60.0, "metadata": np.array(None, dtype=object)}
    found = read_recording(saved(tmp_path / "m.npz", **arrays))
    assert found.unread == ("metadata",)
    with pytest.raises(RobotError, match="root_orient_matrix"):
        odd = {"root_orient_matrix": np.array([None, 1], dtype=object)}
        read_recording(saved(tmp_path / "m.npz", joint_pos=turning[:, 7:], root_pos=turning[:, :3], **odd))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *((name, 60) for name in ("rate_hz", "fps", "frequency", "mocap_framerate", "mocap_frame_rate", "framerate")),
        *((name, 1.0 / 60.0) for name in ("dt", "timestep")),
        ("fps", np.array([60])),
        ("time", np.arange(FRAMES) / 60.0),
    ],
)
def test_a_rate_is_known_under_its_usual_names(humanoid, tmp_path, turning, name, value):
    for path in (saved(tmp_path / "m.npz", qpos=turning, **{name: value}), tmp_path / "m.pt"):
        if path.suffix == ".pt":
            saved(path, qpos=turning, **{name: torch.as_tensor(value)})
        recording = read_recording(path)
        assert (recording.rate_field, recording.rate_hz) == (name, pytest.approx(60.0))
        assert recording.seconds == pytest.approx(1.5)
        assert len(robot_motion(recording, humanoid)) == round(1.5 * RATE_HZ) + 1


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"capture_rate": 60}, "capture_rate is no rate that is known"),
        ({"FPS": 60}, "FPS is no rate"),
        ({"sim_dt": 0.01}, "sim_dt is no rate"),
        ({"fps": 60, "frequency": 30}, "fps says 60 Hz and frequency 30"),
        ({"dt": 0.0}, "its rate is 0"),
        ({"dt": 16.7}, "its rate is 0.0"),
        ({"time": np.zeros(FRAMES)}, "time does not rise evenly"),
        ({"time": np.arange(FRAMES) ** 2.0}, "time does not rise evenly"),
        ({"time": np.full(FRAMES, np.nan)}, "time does not rise evenly"),
        ({"time": 33.0 * np.arange(FRAMES)}, "its rate is 0.03"),
        ({"fps": np.array(None, dtype=object)}, "this NPZ cannot be read"),
    ],
)
def test_a_rate_that_is_none_or_not_known_is_refused(tmp_path, turning, fields, says):
    with pytest.raises(RobotError, match=says):
        read_recording(saved(tmp_path / "m.npz", qpos=turning, **fields))


def test_a_rate_that_nobody_declared_is_told_as_assumed(tmp_path, turning):
    recording = read_recording(saved(tmp_path / "m.npz", qpos=turning))
    assert (recording.rate_hz, recording.rate_field, recording.seconds) == (30.0, "", 3.0)
    rows = "\n".join(",".join(map(str, row)) for row in turning)
    (tmp_path / "m.csv").write_text(rows)
    assert read_recording(tmp_path / "m.csv").rate_field == ""
    (tmp_path / "m.csv").write_text(f"# rate_hz = 60\n{rows}")
    recording = read_recording(tmp_path / "m.csv")
    assert (recording.rate_field, recording.seconds) == ("rate_hz", 1.5)


def test_names_of_joints_count_in_tensors_and_beside_a_base_s(humanoid, tmp_path, turning):
    """LocoMuJoCo names the base's joint too; torch's files have lists of names."""
    model = humanoid.model
    names = [model.joint(joint).name for joint in range(1, model.njnt)]
    order = np.random.default_rng(0).permutation(len(names))
    mixed = [names[index] for index in order]
    locomujoco = turning.copy()
    locomujoco[:, 7:] = turning[:, 7:][:, order]
    files = [
        saved(tmp_path / "l.npz", qpos=locomujoco, joint_names=["root", *mixed], frequency=60.0),
        saved(tmp_path / "m.pt", **gmr(locomujoco), joint_names=mixed, fps=60),
        saved(tmp_path / "a.npz", **gmr(locomujoco), dof_names=mixed, fps=60),
    ]
    expected = robot_motion(read_recording(saved(tmp_path / "r.npz", qpos=turning, fps=60)), humanoid)
    for path in files:
        recording = read_recording(path)
        assert isinstance(recording, RobotRecording) and recording.names == tuple(mixed)
        np.testing.assert_allclose(robot_motion(recording, humanoid), expected, atol=1e-4)


def test_several_motions_in_one_file_are_refused(tmp_path, turning):
    once = saved(tmp_path / "m.npz", qpos=turning, frequency=60.0, split_points=np.array([0, FRAMES]))
    assert read_recording(once).unread == ()
    with pytest.raises(RobotError, match="it holds 2 motions"):
        read_recording(saved(tmp_path / "m.npz", qpos=turning, split_points=np.array([0, 40, FRAMES])))
