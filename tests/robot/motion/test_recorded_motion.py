"""Recorded motions: files and their readings, feet that stand and clear the floor, refusals."""

from __future__ import annotations

import math
import os
import zipfile
from pathlib import Path

import mujoco
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.behaviours.trajectory import RATE_HZ
from r2sego_blender.robot.model.kinematics import LegSolver
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.model.structure import posed
from r2sego_blender.robot.motion.foot_locking import foot_places, plant_feet, planted, spans, stances
from r2sego_blender.robot.motion.recorded_motion import (
    HUMAN_BODIES,
    HumanRecording,
    RobotRecording,
    read_recording,
    resampled,
    robot_motion,
)

G1 = "g1/unitree_mujoco_g1/g1_29dof.xml"
G1_MOUNT = ["torso_link", [0.0576235, 0.01753, 0.42987], [0.0, 0.8307767, 0.0], {"hfov_deg": 69.0}]


def swaying(robot: RobotModel, frames: int = 61, turn_rad: float = 0.0) -> np.ndarray:
    """(T, nq) a robot that stands, turned, leans a little over its feet and waves its arms."""
    qpos = np.tile(robot.rest_qpos, (frames, 1))
    phase = np.linspace(0.0, 2.0 * math.pi, frames)
    lean = Rotation.from_euler("xy", np.stack([0.06 * np.sin(phase), 0.04 * np.cos(phase)], axis=1))
    turn = Rotation.from_euler("z", turn_rad)
    qpos[:, 3:7] = (turn * lean).as_quat(scalar_first=True)
    shoulder = robot.model.jnt_qposadr[robot.shoulders[0]]
    qpos[:, shoulder] += 0.4 * np.sin(phase)
    qpos[:, 2] -= 0.03
    upright = robot.rest_qpos.copy()
    upright[3:7] = turn.as_quat(scalar_first=True)
    LegSolver(robot).solve(qpos, np.repeat(foot_places(robot, upright[None])[0], frames, axis=1))
    return qpos


def csv(path: Path, qpos: np.ndarray, order: str = "wxyz", head: str = "") -> Path:
    rows = qpos.copy()
    if order == "xyzw":
        rows[:, 3:7] = qpos[:, [4, 5, 6, 3]]
    path.write_text(head + "\n".join(",".join(f"{value:.9f}" for value in row) for row in rows) + "\n")
    return path


# Readings


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
@pytest.mark.parametrize("turn", [0.0, 1.2, math.pi])
def test_the_order_of_quaternions_is_found_out(humanoid, tmp_path, order, turn):
    """Turned by half a turn both readings stand upright; the feet tell them apart."""
    qpos = swaying(humanoid, turn_rad=turn)
    recording = read_recording(csv(tmp_path / "sway.csv", qpos, order))
    assert isinstance(recording, RobotRecording)
    assert recording.scalar_first is None
    found = robot_motion(recording, humanoid)
    turned = Rotation.from_quat(found[0, 3:7], scalar_first=True)
    error = turned.inv() * Rotation.from_quat(qpos[0, 3:7], scalar_first=True)
    assert error.magnitude() < 1e-3


@pytest.mark.parametrize("length", [0.97, 1.0, 1.04])
def test_quaternions_of_about_length_1_are_made_of_length_1(humanoid, tmp_path, length):
    qpos = swaying(humanoid)
    qpos[:, 3:7] *= length
    recording = read_recording(csv(tmp_path / "sway.csv", qpos))
    np.testing.assert_allclose(np.linalg.norm(recording.quaternion, axis=1), 1.0, atol=1e-6)
    np.testing.assert_allclose(recording.quaternion, qpos[:, 3:7] / length, atol=1e-6)


def test_a_declared_order_and_rate_win(humanoid, tmp_path):
    qpos = swaying(humanoid, frames=101)
    path = csv(tmp_path / "sway.csv", qpos, "xyzw", '# rate_hz = 100, quaternion = "xyzw"\n')
    recording = read_recording(path)
    assert (recording.rate_hz, recording.scalar_first) == (100.0, False)
    assert len(robot_motion(recording, humanoid)) == 51
    turned = swaying(humanoid, turn_rad=math.pi)
    wrong = csv(tmp_path / "sway.csv", turned, "xyzw", "# quaternion = wxyz\n")
    upside_down = robot_motion(read_recording(wrong), humanoid)
    up = Rotation.from_quat(upside_down[:, 3:7], scalar_first=True).as_matrix()[:, 2, 2]
    assert up.max() < 0.0


def test_joints_may_be_named_and_few(humanoid, tmp_path):
    names = ["x", "y", "z", "w", "qx", "qy", "qz", "left_elbow_joint", "waist_yaw_joint"]
    qpos = np.tile([0.0, 0.0, 0.8, 1.0, 0.0, 0.0, 0.0, 0.5, -0.3], (31, 1))
    qpos[:, 7] += np.linspace(0.0, 0.3, 31)
    found = robot_motion(read_recording(csv(tmp_path / "m.csv", qpos, head=",".join(names) + "\n")), humanoid)
    model = humanoid.model
    np.testing.assert_allclose(found[[0, -1], model.joint("left_elbow_joint").qposadr[0]], [0.5, 0.8], atol=1e-6)
    np.testing.assert_allclose(found[:, model.joint("waist_yaw_joint").qposadr[0]], -0.3)
    other = model.joint("right_elbow_joint").qposadr[0]
    np.testing.assert_allclose(found[:, other], humanoid.rest_qpos[other])


def test_an_npz_of_joints_alone_stands_on_the_floor(humanoid, tmp_path):
    qpos = swaying(humanoid)
    upright = qpos[:, 7:].copy()
    upright[:, :12] = humanoid.rest_qpos[7:19]
    np.savez(tmp_path / "joints.npz", joint_pos=upright, fps=np.array(50.0))
    found = robot_motion(read_recording(tmp_path / "joints.npz"), humanoid)
    np.testing.assert_allclose(found[:, 7:], upright, atol=2e-3)
    np.testing.assert_array_equal(found[:, 3:7], np.tile([1.0, 0.0, 0.0, 0.0], (61, 1)))
    assert np.abs(foot_places(humanoid, found)[1].min(axis=0)).max() < 2e-3
    np.savez(tmp_path / "qpos.npz", qpos=qpos, rate_hz=np.array(50.0))
    whole = robot_motion(read_recording(tmp_path / "qpos.npz"), humanoid)
    turn = Rotation.from_quat(whole[:, 3:7], scalar_first=True).inv()
    assert (turn * Rotation.from_quat(qpos[:, 3:7], scalar_first=True)).magnitude().max() < 1e-6


def test_resampling_keeps_a_steady_motion_steady():
    qpos = np.zeros((31, 9))
    times = np.arange(31) / 30.0
    qpos[:, 0], qpos[:, 8] = 0.7 * times, -0.4 * times
    qpos[:, 3:7] = Rotation.from_euler("z", 2.5 * times[:, None]).as_quat(scalar_first=True)
    found = resampled(qpos, 30.0)
    at = np.arange(51) / RATE_HZ
    np.testing.assert_allclose(found[:, 0], 0.7 * at, atol=1e-9)
    np.testing.assert_allclose(found[:, 8], -0.4 * at, atol=1e-9)
    turn = Rotation.from_quat(found[:, 3:7], scalar_first=True).as_euler("zyx")[:, 0]
    np.testing.assert_allclose(turn, np.angle(np.exp(2.5j * at)), atol=1e-9)


def test_joints_stop_at_their_limits(humanoid, tmp_path):
    qpos = swaying(humanoid)
    address = humanoid.model.joint("left_knee_joint").qposadr[0]
    low, high = humanoid.model.joint("left_knee_joint").range
    qpos[:, address] = low - 0.2
    found = robot_motion(read_recording(csv(tmp_path / "m.csv", qpos)), humanoid)
    assert low <= found[:, address].min() and found[:, address].max() <= high
    qpos[:, address] = low - 0.7
    with pytest.raises(RobotError, match=r"m.csv: left_knee_joint is 0.70 rad beyond the robot's limit"):
        robot_motion(read_recording(csv(tmp_path / "m.csv", qpos)), humanoid)


# Feet


def test_stances_are_slow_and_low_and_no_shorter_than_a_step_s():
    frames = 200
    place = np.zeros((frames, 3))
    moving = np.clip(np.arange(frames) - 60, 0, 40) / 40.0  # a step from frame 60 to 100
    place[:, 0] = 0.5 * moving
    height = 0.1 * np.sin(np.pi * moving)
    height[150:152] = 0.2  # two frames of noise
    stands = stances(place, height)
    assert stands[:55].all() and stands[108:].all()
    assert not stands[65:95].any()


def test_planted_feet_do_not_move_and_swings_clear_the_floor():
    rng = np.random.default_rng(0)
    frames = 150
    foot = np.cumsum(rng.normal(scale=1e-3, size=(frames, 4)), axis=0)
    foot[60:90, 0] += np.linspace(0.0, 0.4, 30)
    foot[90:, 0] += 0.4
    foot[:, 2] = 0.01
    stands = np.ones(frames, bool)
    stands[60:90] = False
    for brisk in (False, True):
        found = planted(foot, stands, brisk)
        for begin, end in spans(stands):
            assert np.ptp(found[begin:end], axis=0).max() < 1e-12
            np.testing.assert_allclose(found[begin, [0, 1, 3]], foot[begin:end].mean(axis=0)[[0, 1, 3]])
            assert found[begin, 2] == 0.0
        assert found[60:90, 2].max() == pytest.approx(0.05, abs=2e-3)
        assert np.abs(np.diff(found[:, 0])).max() < 0.03
    np.testing.assert_array_equal(spans(stands), [[0, 60], [90, 150]])


def test_planting_moves_the_legs_alone_and_no_farther_than_needed(humanoid):
    qpos = swaying(humanoid, 120)
    qpos[:, 0] += 0.02 * np.sin(np.linspace(0.0, 9.0, 120))  # the whole robot skates
    found = plant_feet(humanoid, qpos)
    legs = [humanoid.model.jnt_qposadr[joint] for leg in humanoid.legs for joint in leg.joints]
    others = np.setdiff1d(np.arange(humanoid.model.nq), legs)
    np.testing.assert_array_equal(found[:, others], qpos[:, others])
    places, heights = foot_places(humanoid, found)
    assert np.ptp(places[..., :2], axis=1).max() < 2e-3
    assert np.abs(heights).max() < 2e-3
    assert np.abs(found - qpos).max() < math.radians(12.0)


@pytest.mark.parametrize("name", ["output_walk", "output_wave"])
def test_shared_recordings_of_the_g1(name, shared_robot):
    robot = RobotModel.load(shared_robot(G1), G1_MOUNT)
    recording = read_recording(shared_robot(f"g1/motions/{name}.csv"))
    found = robot_motion(recording, robot)
    assert len(found) == 249
    at = np.rint(np.arange(0, 249, 5) / RATE_HZ * recording.rate_hz).astype(int)
    arms = slice(19, 36)
    np.testing.assert_allclose(found[::5, arms], recording.joints[at, 12:], atol=2e-3)
    away = np.degrees(np.abs(found[::5, 7:19] - recording.joints[at, :12]))
    assert np.median(away) < 2.0 and np.quantile(away, 0.95) < 15.0
    heights = foot_places(robot, found)[1]
    assert np.quantile(heights.min(axis=0), 0.8) < 0.01 and heights.min() > -0.01
    limited = robot.model.jnt_limited.astype(bool)
    angles = found[:, robot.model.jnt_qposadr[limited]]
    assert (angles >= robot.model.jnt_range[limited, 0]).all()
    assert (angles <= robot.model.jnt_range[limited, 1]).all()


def test_the_dance_is_read_as_xyzw(shared_robot):
    robot = RobotModel.load(shared_robot(G1), G1_MOUNT)
    recording = read_recording(shared_robot("g1/motions/dance1_subject2.csv"))
    short = RobotRecording(
        recording.where,
        recording.rate_hz,
        recording.joints[:200],
        (),
        recording.root_m[:200],
        recording.quaternion[:200],
        None,
    )
    found = robot_motion(short, robot)
    np.testing.assert_allclose(found[0, 3:7], recording.quaternion[0, [3, 0, 1, 2]], atol=1e-6)


# Refusals


class Hostile:
    """Unpickled it would leave a mark."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self):
        return Path.touch, (self.marker,)


def test_nothing_in_a_file_is_run(tmp_path):
    marker = tmp_path / "ran"
    torch.save({"rigid_body_pos": Hostile(marker)}, tmp_path / "m.motion")
    with pytest.raises(RobotError, match=r"m.motion: this holds more than tensors, or is damaged"):
        read_recording(tmp_path / "m.motion")
    np.savez(tmp_path / "m.npz", joint_pos=np.array([Hostile(marker)], dtype=object))
    with pytest.raises(RobotError, match=r"m.npz: this NPZ cannot be read"):
        read_recording(tmp_path / "m.npz")
    assert not marker.exists()


@pytest.mark.parametrize("name", ["m.npz", "m.motion"])
def test_a_small_file_that_unpacks_to_much_is_refused(tmp_path, name):
    with (
        zipfile.ZipFile(tmp_path / name, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("joint_pos.npy", "w", force_zip64=True) as entry,
    ):
        for _ in range(300):
            entry.write(bytes(1024 * 1024))
    assert (tmp_path / name).stat().st_size < 1_000_000
    with pytest.raises(RobotError, match=r"the motion is larger than 256 MB unpacked"):
        read_recording(tmp_path / name)


def human(frames: int = 3, bodies: int = len(HUMAN_BODIES)) -> dict[str, torch.Tensor]:
    rotation = torch.zeros(frames, bodies, 4)
    rotation[..., 3] = 1.0
    return {"fps": 30, "rigid_body_pos": torch.zeros(frames, bodies, 3), "rigid_body_rot": rotation}


def test_a_human_s_file_is_read(tmp_path):
    torch.save(human(), tmp_path / "m.motion")
    np.savez(tmp_path / "m.npz", **{key: np.asarray(value) for key, value in human().items()})
    for name in ("m.motion", "m.npz"):
        recording = read_recording(tmp_path / name)
        assert isinstance(recording, HumanRecording)
        assert recording.rate_hz == 30.0
        assert recording.rotation.shape == (3, 24, 3, 3)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"fps": 0}, "its rate is 0"),
        ({"fps": torch.tensor(float("nan"))}, "its rate is nan"),
        ({"rigid_body_rot": torch.zeros(3, 24, 4)}, "rigid_body_rot has not length 1"),
        ({"rigid_body_pos": torch.full((3, 24, 3), float("nan"))}, "rigid_body_pos is no array"),
        ({"rigid_body_pos": torch.full((3, 24, 3), 1e9)}, "farther than a kilometre"),
        ({"rigid_body_pos": torch.zeros(3, 24)}, "rigid_body_pos is no array of 3 dimensions"),
        ({"rigid_body_pos": torch.zeros(4, 24, 3)}, r"rigid_body_pos \(4, 24, 3\) .* are no human"),
        (human(bodies=23), "are no human"),
        (human(frames=1), "the motion has 1 frames"),
    ],
)
def test_humans_that_are_none_are_refused(tmp_path, content, message):
    torch.save(human() | content, tmp_path / "m.motion")
    with pytest.raises(RobotError, match=message) as raised:
        read_recording(tmp_path / "m.motion")
    assert str(raised.value).startswith(str(tmp_path / "m.motion"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "its rows are not a base's seven numbers"),
        ("1,2,3\n4,5,6\n", "its rows are not a base's seven numbers"),
        ("0,0,1,1,0,0,0,0\n0,0,1,1,0,0,0\n", "its rows are not numbers of one count"),
        ("0,0,1,1,0,0,0,0\n0,0,1,1,0,0,0,x\n", "its rows are not numbers of one count"),
        ("0,0,1,1,0,0,0,0\n", "the motion has 1 frames"),
        ("0,0,1,1,0,0,0,0\n0,0,1,1,0,0,0,nan\n", "the joints are not 2 rows of 1 finite numbers"),
        ("0,0,1e9,1,0,0,0,0\n" * 2, "the root lies farther than a kilometre"),
        ("0,0,1,3,0,0,0,0\n" * 2, "the quaternion has not length 1"),
        ("# rate_hz = 0\n" + "0,0,1,1,0,0,0,0\n" * 2, "its rate is 0"),
        ("# rate = 30\n" + "0,0,1,1,0,0,0,0\n" * 2, "'rate' is declared. Known: # rate_hz"),
        ("# quaternion = zyxw\n" + "0,0,1,1,0,0,0,0\n" * 2, "quaternion is declared as zyxw"),
        ("\x00\ufffe" * 9, "its rows are not"),
    ],
)
def test_tables_that_are_no_motions_are_refused(tmp_path, text, message):
    (tmp_path / "m.csv").write_text(text, encoding="utf-8")
    with pytest.raises(RobotError, match=message) as raised:
        read_recording(tmp_path / "m.csv")
    assert str(raised.value).startswith(str(tmp_path / "m.csv"))


def test_other_files_are_refused(tmp_path, humanoid):
    (tmp_path / "m.csv").write_bytes(b"\xff\xfe\x80" * 30)
    (tmp_path / "m.npz").write_bytes(b"PK\x03\x04" + b"\x00" * 40)
    (tmp_path / "m.motion").write_bytes(b"\x80\x02}q\x00.")
    (tmp_path / "m.bvh").write_text("HIERARCHY")
    np.savez(tmp_path / "empty.npz", nothing=np.zeros(3))
    for name, message in (
        ("m.csv", "this is no text"),
        ("m.npz", "this NPZ cannot be read"),
        ("m.bvh", "'.bvh' is no motion"),
        ("m.motion", "."),
        ("none.csv", "this motion cannot be read"),
        ("empty.npz", "it has neither qpos, joint_pos nor rigid_body_pos"),
    ):
        with pytest.raises(RobotError, match=message):
            read_recording(tmp_path / name)
    short = csv(tmp_path / "short.csv", np.tile([0.0, 0.0, 0.8, 1.0, 0.0, 0.0, 0.0, 0.1], (5, 1)))
    with pytest.raises(RobotError, match=r"it moves 1 joints; the robot has 29"):
        robot_motion(read_recording(short), humanoid)
    named = csv(
        tmp_path / "named.csv", np.tile([0.0, 0.0, 0.8, 1.0, 0.0, 0.0, 0.0, 0.1], (5, 1)), head="x,y,z,w,a,b,c,tail\n"
    )
    with pytest.raises(RobotError, match=r"the robot has no joint tail. It has: left_hip"):
        robot_motion(read_recording(named), humanoid)


def test_foot_places_are_forward_kinematics(humanoid):
    qpos = swaying(humanoid, 5)
    places, heights = foot_places(humanoid, qpos)
    data = mujoco.MjData(humanoid.model)
    for frame in range(5):
        data.qpos[:] = qpos[frame]
        mujoco.mj_forward(humanoid.model, data)
        for leg, place in zip(humanoid.legs, places[:, frame], strict=True):
            np.testing.assert_allclose(place[:3], data.xpos[leg.foot])
    level = np.tile(humanoid.rest_qpos, (1, 1))
    places, heights = foot_places(humanoid, level)
    soles = [leg.sole_m for leg in humanoid.legs]
    np.testing.assert_allclose(places[:, 0, 2] - heights[:, 0], soles, atol=1e-6)


def test_point_feet_are_planted_by_their_tips(quadruped):
    """The body of a point foot begins at its knee, which moves while the foot stands."""
    still = np.tile(quadruped.rest_qpos, (40, 1))
    soles = foot_places(quadruped, still)[0]
    still[:, 2] -= 0.03 * np.sin(np.linspace(0.0, math.pi, 40))  # it crouches on feet that stand
    LegSolver(quadruped).solve(still, soles)
    places, heights = foot_places(quadruped, still)
    np.testing.assert_allclose(places[..., :3], soles[..., :3], atol=1e-4)
    assert np.abs(heights).max() < 5e-3
    skating = still.copy()
    skating[:, 0] += 0.02 * np.sin(np.linspace(0.0, 3.0, 40))
    found = plant_feet(quadruped, skating)
    places, heights = foot_places(quadruped, found)
    assert np.ptp(places[..., :2], axis=1).max() < 2e-3
    assert np.abs(heights).max() < 2e-3


def test_the_origin_of_a_foot_stands_its_height_above_the_sole(humanoid, quadruped):
    for robot in (humanoid, quadruped):
        data = posed(robot.model, robot.rest_qpos)
        for leg in robot.legs:
            assert data.xpos[leg.foot, 2] - leg.origin_m == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("head", ["", '# rate_hz = 100, quaternion = "xyzw"\n'])
def test_a_mark_before_utf_8_is_no_part_of_a_table(humanoid, tmp_path, head):
    plain = csv(tmp_path / "plain.csv", swaying(humanoid), "xyzw", head)
    (tmp_path / "marked.csv").write_bytes(b"\xef\xbb\xbf" + plain.read_bytes())
    expected, found = (read_recording(tmp_path / name) for name in ("plain.csv", "marked.csv"))
    assert found.names == expected.names and found.rate_hz == expected.rate_hz
    np.testing.assert_array_equal(found.joints, expected.joints)


@pytest.mark.parametrize("bodies", [("body_pos_w", (0, 5, 3)), ("strange", (0, 4)), ("other", (0, 3, 3))])
def test_a_motion_without_frames_is_refused(tmp_path, bodies):
    name, shape = bodies
    np.savez(tmp_path / "m.npz", joint_pos=np.zeros((0, 29)), **{name: np.zeros(shape)})
    with pytest.raises(RobotError, match=r"m\.npz"):
        read_recording(tmp_path / "m.npz")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes of other systems")
@pytest.mark.parametrize("suffix", [".csv", ".npz", ".pt", ".motion"])
def test_a_pipe_is_no_motion(tmp_path, suffix):
    os.mkfifo(tmp_path / f"m{suffix}")  # which would never end
    with pytest.raises(RobotError, match=rf"m\{suffix}"):
        read_recording(tmp_path / f"m{suffix}")
