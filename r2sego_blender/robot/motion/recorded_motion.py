"""Recorded motions: a robot's joints from CSV or NPZ, a human's bodies from NPZ or ``.motion``.

Nothing in these files is run: pickled objects are refused.
"""

from __future__ import annotations

import io
import pickle
import re
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
from scipy import ndimage
from scipy.spatial.transform import Rotation, Slerp

from ...core.arrays import opened_arrays
from ...core.errors import RobotError
from ...core.text_files import open_zip, opened_file
from ..behaviours.trajectory import RATE_HZ
from ..model.model import RobotModel
from .body_motion import RecordedBodies, explained, joint_orders
from .foot_locking import foot_places, plant_feet
from .motion_fields import (
    BODY_NAMES,
    BODY_POSITIONS,
    BODY_ROTATIONS,
    CURE,
    DEFAULT_RATE_HZ,
    JOINT_NAMES,
    JOINTS,
    KNOWN,
    QUATERNION_ORDER,
    ROOT_POSITIONS,
    ROOT_ROTATIONS,
    MotionFields,
    checked_rate,
    motion_error,
)
from .motion_tensors import tensors_of

_MAX_BYTES, _MOST_LIST_BYTES = 256 * 1024 * 1024, 1 << 20
_MAX_FRAMES, _MAX_BODIES = 200_000, 1000
_FARTHEST_M, _FARTHEST_RAD = 1000.0, 1e6
_ROUNDED = 1e-6  # of a quaternion's length: numbers of so many digits are as they are
_LONGEST_LINE, _LONGEST_COMMENT = 100_000, 1000
_DECLARED = re.compile(r"(\w+)\s*=\s*\"?([\w.]+)\"?")
# A motion that leaves a joint's range by more is another robot's.
_BEYOND_RAD = 0.5
_LIMIT_MARGIN_RAD = 0.005
_LEVELLING_S = 0.03
# The mean up axis tells the readings of a quaternion apart where they differ by more.
_UPRIGHT_BY = 0.05
_READINGS = {True: [0, 1, 2, 3], False: [3, 0, 1, 2]}  # by whether a quaternion is wxyz

HUMAN_BODIES = (
    "pelvis",
    "left_hip",
    "left_knee",
    "left_ankle",
    "left_toe",
    "right_hip",
    "right_knee",
    "right_ankle",
    "right_toe",
    "torso",
    "spine",
    "chest",
    "neck",
    "head",
    "left_thorax",
    "left_shoulder",
    "left_elbow",
    "left_wrist",
    "left_hand",
    "right_thorax",
    "right_shoulder",
    "right_elbow",
    "right_wrist",
    "right_hand",
)
"""Bodies of the SMPL humanoid, in the order of its files."""


@dataclass(frozen=True)
class RobotRecording:
    """A robot's motion as its file has it.

    ``joints`` (T, n) radians, named by ``names`` or, without, in the robot's own order;
    ``root_m`` (T, 3) and ``quaternion`` (T, 4) of the base, None where it was not recorded;
    ``scalar_first`` whether a quaternion is wxyz, None: to be found out. ``bodies`` are those
    recorded beside. ``rate_field`` says the rate, '' where it is assumed; ``unread`` are the file's
    other fields.
    """

    where: str
    rate_hz: float
    joints: np.ndarray
    names: tuple[str, ...]
    root_m: np.ndarray | None
    quaternion: np.ndarray | None
    scalar_first: bool | None
    bodies: RecordedBodies | None = None
    rate_field: str = ""
    unread: tuple[str, ...] = ()

    @property
    def seconds(self) -> float:
        """How long it lasts."""
        return (len(self.joints) - 1) / self.rate_hz


@dataclass(frozen=True)
class HumanRecording:
    """A human's motion: ``HUMAN_BODIES`` in a world with z up, metres.

    ``position_m`` (T, 24, 3); ``rotation`` (T, 24, 3, 3) from the pose that stands upright,
    faces x and has its arms stretched out to the sides. ``rate_field`` and ``unread`` as a robot's.
    """

    where: str
    rate_hz: float
    position_m: np.ndarray
    rotation: np.ndarray
    rate_field: str = ""
    unread: tuple[str, ...] = ()

    @property
    def seconds(self) -> float:
        """How long it lasts."""
        return (len(self.position_m) - 1) / self.rate_hz


def read_recording(path: str | Path) -> RobotRecording | HumanRecording:
    """Read a recorded motion. Raises RobotError naming the file and the field."""
    path = Path(path)
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise motion_error(path, "the motion is larger than 256 MB", "Cut it.")
    except (OSError, ValueError) as error:  # also a name that no file can have
        raise motion_error(path, "this motion cannot be read", "Check controller.motions of the scope.") from error
    match path.suffix.lower():
        case ".csv":
            return _read_csv(path)
        case ".npz":
            arrays = _read_npz(path)
        case ".motion" | ".pt":
            arrays = _read_tensors(path)
        case suffix:
            raise motion_error(path, f"'{suffix}' is no motion")
    fields = MotionFields(path, arrays)
    return _human(fields) if "rigid_body_pos" in arrays else _robot(fields)


def robot_motion(recording: RobotRecording, robot: RobotModel) -> np.ndarray:
    """(T, nq) float64 at ``RATE_HZ``: the recording on ``robot``, its soles on z = 0.

    The legs are corrected so that feet stand still and clear the floor in between. Joints
    that were not recorded rest; joints beyond their limits stop there. Raises RobotError
    where the joints are not this robot's.
    """
    model, count = robot.model, len(recording.joints)
    own = [joint for joint in range(model.njnt) if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE]
    recording = _with_base(recording, robot)
    names = recording.names or tuple(model.joint(joint).name for joint in own)
    if recording.joints.shape[1] != len(names):
        raise motion_error(
            recording.where,
            f"it moves {recording.joints.shape[1]} joints; the robot has {len(names)}",
            "Give a motion of this robot, or name the joints in its first line.",
        )
    known = {model.joint(joint).name: joint for joint in own}
    if unknown := [name for name in names if name not in known]:
        raise motion_error(recording.where, f"the robot has no joint {unknown[0]}", f"It has: {', '.join(known)}.")
    qpos = np.tile(robot.rest_qpos, (count, 1))
    for name, angles in zip(names, recording.joints.T, strict=True):
        joint = known[name]
        if model.jnt_limited[joint]:
            low, high = model.jnt_range[joint]
            beyond = max(float((low - angles).max()), float((angles - high).max()))
            if beyond > _BEYOND_RAD:
                raise motion_error(
                    recording.where,
                    f"{name} is {beyond:.2f} rad beyond the robot's limit",
                    "Give a motion of this robot.",
                )
            angles = np.clip(angles, low + _LIMIT_MARGIN_RAD, high - _LIMIT_MARGIN_RAD)
        qpos[:, model.jnt_qposadr[joint]] = angles
    if recording.root_m is not None:
        qpos[:, :3] = recording.root_m
    if recording.quaternion is not None:
        scalar_first = recording.scalar_first
        if scalar_first is None:
            scalar_first = _is_scalar_first(robot, qpos, recording.quaternion)
        qpos[:, 3:7] = recording.quaternion[:, _READINGS[scalar_first]]
    qpos = resampled(qpos, recording.rate_hz)
    # Some foot always stands: the base is as high as the lower one has it.
    lowest = foot_places(robot, qpos)[1].min(axis=0)
    qpos[:, 2] -= ndimage.gaussian_filter1d(lowest, _LEVELLING_S * RATE_HZ, mode="nearest")
    return plant_feet(robot, qpos)


def _with_base(recording: RobotRecording, robot: RobotModel) -> RobotRecording:
    """``recording`` with what its bodies say that it does not: the base's pose and the joints' order.

    Raises RobotError where they do not say it, or say that this is another robot.
    """
    bodies = recording.bodies
    if bodies is None or (recording.names and recording.root_m is not None and recording.quaternion is not None):
        return recording
    orders = [recording.names] if recording.names else joint_orders(robot)
    known = {name for order in joint_orders(robot) for name in order}
    if recording.joints.shape[1] != len(orders[0]) or not known.issuperset(orders[0]):
        return recording  # which is refused for it
    base = bodies.base(robot)
    quaternion = recording.quaternion if bodies.quaternion is None else bodies.quaternion[:, base]
    assert quaternion is not None  # else it was not read
    scalar_first = [True, False] if recording.scalar_first is None else [recording.scalar_first]
    readings = [quaternion[:, _READINGS[first]] for first in scalar_first]
    names, reading = explained(recording.where, bodies, recording.joints, orders, readings, robot)
    if recording.quaternion is None:
        recording = replace(recording, quaternion=reading, scalar_first=True)
    root_m = bodies.position_m[:, base] if recording.root_m is None else recording.root_m
    return replace(recording, names=names, root_m=root_m)


def frame_count(seconds: float) -> int:
    """The frames at ``RATE_HZ`` of a recording that lasts so long."""
    return int(seconds * RATE_HZ + 1e-9) + 1


def resampled(qpos: np.ndarray, rate_hz: float) -> np.ndarray:
    """``qpos`` (T, nq), a free base first, from ``rate_hz`` to ``RATE_HZ``; float64."""
    times = np.arange(len(qpos)) / rate_hz
    at = np.arange(frame_count(times[-1])) / RATE_HZ
    frame = np.minimum((at * rate_hz).astype(int), len(qpos) - 2)
    part = (at * rate_hz - frame)[:, None]
    between = (1.0 - part) * qpos[frame] + part * qpos[frame + 1]
    turns = Rotation.from_quat(qpos[:, 3:7], scalar_first=True)
    between[:, 3:7] = Slerp(times, turns)(np.minimum(at, times[-1])).as_quat(scalar_first=True)
    return between


def _is_scalar_first(robot: RobotModel, qpos: np.ndarray, quaternion: np.ndarray) -> bool:
    """Whether read as wxyz the base is more upright than as xyzw; turned by 180 degrees both
    readings stand, and the one that keeps the lower foot on one level is right."""
    readings = [quaternion, quaternion[:, [3, 0, 1, 2]]]
    upright = [float(np.mean(1.0 - 2.0 * (q[:, 1] ** 2 + q[:, 2] ** 2))) for q in readings]
    if abs(upright[0] - upright[1]) > _UPRIGHT_BY:
        return upright[0] > upright[1]
    wanders = []
    for reading in readings:
        posed = qpos.copy()
        posed[:, 3:7] = reading
        wanders.append(float(np.std(foot_places(robot, posed)[1].min(axis=0))))
    return wanders[0] <= wanders[1]


def _read_csv(path: Path) -> RobotRecording:
    declared: dict[str, str] = {}
    names: tuple[str, ...] = ()
    rows: list[np.ndarray] = []
    try:
        for line in _lines(path):
            if line.startswith("#") and not (rows or names):
                declared.update(_DECLARED.findall(line[:_LONGEST_COMMENT]))
            elif not (rows or names) and not _is_number(line.split(",")[0]):
                names = tuple(name.strip() for name in line.split(","))
            elif len(rows) == _MAX_FRAMES:
                raise motion_error(path, f"the motion has more than {_MAX_FRAMES} frames", "Cut it.")
            else:
                rows.append(np.array([float(value) for value in line.split(",")]))
        if unknown := sorted(set(declared) - {"rate_hz", "quaternion"}):
            raise motion_error(path, f"'{unknown[0]}' is declared", "Known: # rate_hz = 30, quaternion = wxyz.")
        table = np.stack(rows) if rows else np.empty(0)
    except UnicodeDecodeError as error:
        raise motion_error(path, "this is no text") from error
    except (ValueError, OSError) as error:
        raise motion_error(path, f"its rows are not numbers of one count: {error}") from error
    if table.ndim != 2 or table.shape[1] < 8 or (names and len(names) != table.shape[1]):
        raise motion_error(path, "its rows are not a base's seven numbers and joints")
    return _checked(
        RobotRecording(
            str(path),
            checked_rate(path, declared.get("rate_hz", DEFAULT_RATE_HZ)),
            table[:, 7:],
            names[7:],
            table[:, :3],
            table[:, 3:7],
            _scalar_first(path, declared.get("quaternion")),
            rate_field="rate_hz" if "rate_hz" in declared else "",
        )
    )


def _lines(path: Path) -> Iterator[str]:
    """The lines that hold something, one at a time; a mark before UTF-8 is none. Raises OSError and ValueError."""
    with opened_file(path) as file, io.TextIOWrapper(file, encoding="utf-8-sig") as text:
        while line := text.readline(_LONGEST_LINE):
            if len(line) == _LONGEST_LINE:
                raise ValueError(f"a line has more than {_LONGEST_LINE} characters")
            if line := line.strip():
                yield line


def _read_npz(path: Path) -> dict[str, np.ndarray | None]:
    what = "this NPZ cannot be read"
    _check_unpacked(path, what)
    found: dict[str, np.ndarray | None] = {}
    with opened_arrays(path, RobotError, what, CURE) as arrays:
        for name in arrays:
            try:
                found[name] = arrays[name]
            except ValueError:  # objects, as other programs put beside their arrays
                if name in KNOWN:
                    raise
                found[name] = None
    return found


def _check_unpacked(path: Path, what: str) -> None:
    try:
        with opened_file(path) as stream, open_zip(stream, _MOST_LIST_BYTES) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, NotImplementedError) as error:
        raise motion_error(path, f"{what}: {str(error).partition(chr(10))[0]}") from error
    if unpacked > _MAX_BYTES:
        raise motion_error(path, "the motion is larger than 256 MB unpacked", "Cut it.")


def _read_tensors(path: Path) -> dict[str, np.ndarray | None]:
    damaged = "this holds more than tensors, or is damaged"
    _check_unpacked(path, damaged)
    try:
        return tensors_of(path)
    except TypeError as error:
        raise motion_error(path, str(error)) from error
    except (OSError, ValueError, RuntimeError, pickle.UnpicklingError, zipfile.BadZipFile) as error:
        cure = "Save plain tensors by their names, with torch 1.6 or later."
        raise motion_error(path, f"{damaged}: {error}", cure) from error


def _human(fields: MotionFields) -> HumanRecording:
    path, bodies = fields.path, len(HUMAN_BODIES)
    position, rotation = (fields.array([name], 3) for name in ("rigid_body_pos", "rigid_body_rot"))
    if (
        position is None
        or rotation is None
        or position.shape[1:] != (bodies, 3)
        or rotation.shape != (*position.shape[:2], 4)
    ):
        raise motion_error(
            path,
            f"rigid_body_pos {_shape(position)} and rigid_body_rot {_shape(rotation)} are no human",
            f"Give (T, {bodies}, 3) and (T, {bodies}, 4), xyzw: the bodies of the SMPL humanoid.",
        )
    _check_frames(path, len(position))
    if np.abs(position).max() > _FARTHEST_M:
        raise motion_error(path, "rigid_body_pos lies farther than a kilometre", "Metres are expected.")
    turns = Rotation.from_quat(_unit(path, rotation.reshape(-1, 4), "rigid_body_rot"))
    rate_hz, rate_field = fields.rate_hz()
    matrices = turns.as_matrix().reshape(*position.shape[:2], 3, 3)
    return HumanRecording(str(path), rate_hz, position, matrices, rate_field, fields.unread)


def _robot(fields: MotionFields) -> RobotRecording:
    path = fields.path
    rate_hz, rate_field = fields.rate_hz()
    names = fields.words(JOINT_NAMES)
    qpos = fields.array(["qpos"], 2)
    if qpos is not None:
        if qpos.shape[1] < 8:
            raise motion_error(path, f"qpos is {qpos.shape}", "Give a base's seven numbers (wxyz), and joints.")
        if len(names) == qpos.shape[1] - 6:  # LocoMuJoCo names the base's joint too
            names = names[1:]
        splits = fields.array(["split_points"], 1)
        if splits is not None and len(splits) > 2:  # LocoMuJoCo's files may hold several
            raise motion_error(path, f"it holds {len(splits) - 1} motions", "Give each a file of its own.")
        parts = (qpos[:, 7:], names, qpos[:, :3], qpos[:, 3:7], True)
        return _checked(RobotRecording(str(path), rate_hz, *parts, rate_field=rate_field, unread=fields.unread))
    joints = fields.array(JOINTS, 2)
    if joints is None:
        raise motion_error(path, "it has neither qpos, joint_pos nor rigid_body_pos")
    _check_frames(path, len(joints))
    root, quaternion = fields.rows(ROOT_POSITIONS, len(joints), 3), fields.rows(ROOT_ROTATIONS, len(joints), 4)
    order = "".join(fields.words(QUATERNION_ORDER))
    bodies = _bodies(fields, len(joints), quaternion is not None)
    fields.refuse_lost_base(
        len(joints),
        bool(bodies or root is not None),
        quaternion is not None or bool(bodies and bodies.quaternion is not None),
    )
    recording = RobotRecording(
        str(path),
        rate_hz,
        joints,
        names,
        root,
        quaternion,
        _scalar_first(path, order or None),
        bodies,
        rate_field,
        fields.unread,
    )
    return _checked(recording)


def _bodies(fields: MotionFields, frames: int, has_rotation: bool) -> RecordedBodies | None:
    """What the file has of the robot's bodies. Raises RobotError where that says nothing of the base."""
    position, quaternion = fields.array(BODY_POSITIONS, 3), fields.array(BODY_ROTATIONS, 3)
    names = fields.words(BODY_NAMES)
    if position is None and quaternion is None:
        return None
    path, count = fields.path, 0 if position is None else position.shape[1]
    if (
        position is None
        or position.shape != (frames, count, 3)
        or (quaternion is not None and quaternion.shape != (frames, count, 4))
        or not 1 <= count <= _MAX_BODIES
        or (names and len(names) != count)
    ):
        what = f"its bodies' places {_shape(position)} and rotations {_shape(quaternion)} do not belong together"
        raise motion_error(path, what, f"Give ({frames}, B, 3) and ({frames}, B, 4), or leave them out.")
    if np.abs(position).max() > _FARTHEST_M:
        raise motion_error(path, "a body lies farther than a kilometre", "Metres are expected.")
    if quaternion is None and not has_rotation:
        what = "its bodies' places stand without rotations, so that the base's is not known"
        raise motion_error(path, what, f"Give {ROOT_ROTATIONS[0]}, or leave {BODY_POSITIONS[0]} out.")
    if quaternion is not None:
        quaternion = _unit(path, quaternion, "a body's quaternion")
    return RecordedBodies(position, quaternion, names)


def _shape(values: np.ndarray | None) -> tuple[int, ...]:
    return () if values is None else values.shape


def _scalar_first(path: Path, order: str | None) -> bool | None:
    """Whether a declared order is wxyz; None where none is declared. Raises RobotError."""
    if order not in (None, "wxyz", "xyzw"):
        raise motion_error(path, f"quaternion is declared as {order}", "Declare wxyz or xyzw.")
    return None if order is None else order == "wxyz"


def _checked(recording: RobotRecording) -> RobotRecording:
    path, count = recording.where, len(recording.joints)
    _check_frames(path, count)
    numbers = [recording.joints, recording.root_m, recording.quaternion]
    widths = (recording.joints.shape[1], 3, 4)
    for field, values, width in zip(("the joints", "the root", "the quaternion"), numbers, widths, strict=True):
        if values is not None and (values.shape != (count, width) or not np.isfinite(values).all()):
            raise motion_error(path, f"{field} are not {count} rows of {width} finite numbers")
    if np.abs(recording.joints).max(initial=0.0) > _FARTHEST_RAD:
        raise motion_error(path, "a joint turns more often than any does", "Radians are expected.")
    if recording.root_m is not None and np.abs(recording.root_m).max() > _FARTHEST_M:
        raise motion_error(path, "the root lies farther than a kilometre", "Metres are expected.")
    if recording.quaternion is not None:
        recording = replace(recording, quaternion=_unit(path, recording.quaternion, "the quaternion"))
    return recording


def _unit(path: object, quaternion: np.ndarray, field: str) -> np.ndarray:
    """``quaternion`` (..., 4), made exactly of length 1 where it is rounded. Raises RobotError where it is another."""
    length = np.linalg.norm(quaternion, axis=-1, keepdims=True)
    if np.abs(length - 1.0).max() > 0.05:
        raise motion_error(path, f"{field} has not length 1", "Give rotations as unit quaternions.")
    return np.where(np.abs(length - 1.0) > _ROUNDED, quaternion / length, quaternion)


def _check_frames(path: object, count: int) -> None:
    if not 2 <= count <= _MAX_FRAMES:
        raise motion_error(path, f"the motion has {count} frames", f"Give 2 to {_MAX_FRAMES}.")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
