"""What the arrays of a motion's file are, under the names that programs give them.

A field that is passed over is another motion: so one that is not known and looks like the base's pose
or the rate is refused where there is no other, and the rest is listed, for people to see. Names are those of
LocoMuJoCo, AMASS, GMR and TWIST, PHC, ProtoMotions, Isaac Lab, whole_body_tracking (BeyondMimic) and mjlab.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import RobotError

DEFAULT_RATE_HZ = 30.0
"""Rate of recordings that declare none: the usual one of motion capture."""

JOINTS = ("joint_pos", "dof_pos", "joint_positions", "dof_positions", "dof")
JOINT_NAMES = ("joint_names", "dof_names")
ROOT_POSITIONS = ("root_pos", "root_trans", "root_trans_offset", "base_pos", "root_position", "base_position")
ROOT_ROTATIONS = (
    "root_quat",
    "root_rot",
    "base_quat",
    "base_rot",
    "root_quaternion",
    "root_rotation",
    "root_orientation",
)
BODY_POSITIONS = ("body_pos_w", "body_positions")
BODY_ROTATIONS = ("body_quat_w", "body_rotations")
BODY_NAMES = ("body_names",)
QUATERNION_ORDER = ("quaternion_order", "quaternion")

RATES = ("rate_hz", "fps", "frequency", "framerate", "frame_rate", "mocap_framerate", "mocap_frame_rate")
_PERIODS = ("dt", "timestep", "time_step")
_TIMES = ("time", "times", "timestamps")
KNOWN = frozenset(
    (
        *("qpos", "rigid_body_pos", "rigid_body_rot", *JOINTS, *JOINT_NAMES, *ROOT_POSITIONS, *ROOT_ROTATIONS),
        *(*BODY_POSITIONS, *BODY_ROTATIONS, *BODY_NAMES, *QUATERNION_ORDER, *RATES, *_PERIODS),
    )
)
"""What a motion is made of; of anything else no more than its name and shape counts."""

_RATE_LIKE = re.compile(r"fps|hz|freq|rate|(^|_)dt($|_)|period|time_?step")
_CHANGES = re.compile(r"vel|acc|force|torque|action|contact|grav")
_ROTATION_LIKE = re.compile(r"rot|quat|orient|euler|rpy|pose|yaw|heading|transform|axis_?angle", re.IGNORECASE)
_POSITION_LIKE = re.compile(r"pos|trans|xyz", re.IGNORECASE)
_BASE_LIKE = re.compile(r"root|base|pelvis", re.IGNORECASE)
_MOST_NAMES = 1000
_SAME_RATE, _EVEN, _UNIT = 0.01, 0.05, 1e-3
CURE = "Give a CSV or NPZ of the robot's joints, or the bodies of a human; see docs/controllers.md."


@dataclass
class MotionFields:
    """The arrays of the motion at ``path`` by name; None for what is no array. What is asked for counts as read."""

    path: Path
    arrays: Mapping[str, np.ndarray | None]
    _read: set[str] = field(default_factory=set)

    @property
    def unread(self) -> tuple[str, ...]:
        """What nobody asked for."""
        return tuple(sorted(set(self.arrays) - self._read))

    def name(self, names: Sequence[str]) -> str | None:
        """The first of ``names`` that the file has."""
        found = next((name for name in names if name in self.arrays), None)
        if found is not None:
            self._read.add(found)
        return found

    def array(self, names: Sequence[str], dimensions: int) -> np.ndarray | None:
        """The first of ``names`` as float64, or None. Raises RobotError where it is none of finite numbers."""
        name = self.name(names)
        if name is None:
            return None
        values = np.asarray(self.arrays[name])
        if values.ndim != dimensions or values.dtype.kind not in "fiu" or not np.isfinite(values).all():
            raise motion_error(self.path, f"{name} is no array of {dimensions} dimensions and finite numbers")
        return values.astype(np.float64)

    def rows(self, names: Sequence[str], count: int, width: int) -> np.ndarray | None:
        """The first of ``names`` as (count, width) float64, or None. Raises RobotError where it is of another shape."""
        values, name = self.array(names, 2), self.name(names)
        if values is not None and values.shape != (count, width):
            raise motion_error(
                self.path, f"{name} has the shape {values.shape}", f"Give {count} rows of {width} numbers."
            )
        return values

    def words(self, names: Sequence[str]) -> tuple[str, ...]:
        """The texts of the first of ``names``; none where there is none. Raises RobotError for other things."""
        name = self.name(names)
        values = np.asarray(()) if name is None else np.asarray(self.arrays[name])
        if values.size > _MOST_NAMES or (values.size and values.dtype.kind not in "US"):
            raise motion_error(self.path, f"{name} holds no names", "Save them as text, without objects.")
        return tuple(one.decode(errors="replace") if isinstance(one, bytes) else str(one) for one in values.ravel())

    def rate_hz(self) -> tuple[float, str]:
        """Frames a second, and the field that says so: '' where 30 Hz is assumed. Raises RobotError."""
        told = {name: checked_rate(self.path, self.arrays[name]) for name in RATES if self.name([name])}
        for first, rate_hz in told.items():
            for other, other_hz in told.items():
                if abs(other_hz / rate_hz - 1.0) > _SAME_RATE:
                    what = f"{first} says {rate_hz:g} Hz and {other} {other_hz:g}"
                    raise motion_error(self.path, what, "Leave one of them.")
            return rate_hz, first
        if period := self.name(_PERIODS):
            period_s = _number(self.arrays[period])
            return checked_rate(self.path, 1.0 / period_s if period_s else period_s), period
        if (times := next((name for name in _TIMES if name in self.arrays), None)) is not None:
            seconds = self.arrays[times]
            if seconds is not None and seconds.ndim == 1 and self.name([times]):
                rate_hz = _rate_of_times(seconds)
                if np.isnan(rate_hz):
                    raise motion_error(self.path, f"{times} does not rise evenly", "Give evenly spaced frames.")
                return checked_rate(self.path, rate_hz), times
        if unknown := [name for name in self.unread if _is_rate(name, self.arrays[name])]:
            raise motion_error(self.path, f"{unknown[0]} is no rate that is known", "Call it rate_hz, or leave it out.")
        return DEFAULT_RATE_HZ, ""

    def refuse_lost_base(self, frames: int, has_position: bool, has_rotation: bool) -> None:
        """Raise RobotError for a field of ``frames`` rows that may be the base's pose, where that was not found."""
        for name in self.unread:
            values = self.arrays[name]
            if values is not None and (values.ndim < 2 or len(values) != frames or _CHANGES.search(name.lower())):
                continue
            of_base = bool(_BASE_LIKE.search(name))
            if not has_rotation and (of_base or _is_rotation(name, values)):
                raise motion_error(
                    self.path,
                    f"{name} may be the base's rotation, which nothing else says",
                    f"Call it {ROOT_ROTATIONS[0]} and give quaternions, or leave it out.",
                )
            placed = (of_base or _POSITION_LIKE.search(name)) and (values is None or values.shape[-1] == 3)
            if not has_position and placed:
                raise motion_error(
                    self.path,
                    f"{name} may be the base's place, which nothing else says",
                    f"Call it {ROOT_POSITIONS[0]}, or leave it out.",
                )


def checked_rate(path: Path, value: Any) -> float:
    """Frames a second, from 1 to 1000. Raises RobotError."""
    rate_hz = _number(value)
    if not 1.0 <= rate_hz <= 1000.0:
        raise motion_error(path, f"its rate is {value}", "Declare 1 to 1000 Hz.")
    return rate_hz


def motion_error(path: object, what: str, cure: str = CURE) -> RobotError:
    """The error about the motion at ``path``."""
    return RobotError(what, where=path, cure=cure)


def _number(value: Any) -> float:
    """The one number of ``value``, NaN where it is none."""
    try:
        values = np.asarray(value).ravel()
        return float(values[0]) if len(values) == 1 else np.nan
    except (TypeError, ValueError, OverflowError):
        return np.nan


def _rate_of_times(times_s: np.ndarray) -> float:
    """Of (T,) seconds, evenly apart; else NaN."""
    if times_s.dtype.kind not in "fiu" or len(times_s) < 2 or not np.isfinite(times_s).all():
        return np.nan
    steps = np.diff(times_s.astype(np.float64))
    if steps.min() <= 0.0 or np.ptp(steps) > _EVEN * steps.mean():
        return np.nan
    return float(1.0 / steps.mean())


def _is_rate(name: str, values: np.ndarray | None) -> bool:
    return bool(_RATE_LIKE.search(name.lower())) and (values is None or values.size == 1)


def _is_rotation(name: str, values: np.ndarray | None) -> bool:
    """Whether the name says so, or the numbers are unit quaternions (T, 4) or matrices (T, 3, 3)."""
    if _ROTATION_LIKE.search(name):
        return True
    if values is None or values.dtype.kind != "f" or not np.isfinite(values).all():
        return False
    if values.shape[1:] == (4,):
        return bool(np.abs(np.linalg.norm(values, axis=1) - 1.0).max(initial=0.0) < _UNIT)
    if values.shape[1:] == (3, 3):
        return bool(np.abs(values @ values.transpose(0, 2, 1) - np.eye(3)).max(initial=0.0) < _UNIT)
    return False
