"""The declared observation layout of a learned policy (docs/controllers.md lists its fields)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...config.declared_files import Reader
from ...config.fields import Range, setting
from ...core.errors import RobotError
from ..model.humanoid import Servo
from ..scope.scope import LAYOUTS

_MAX_HISTORY = 1000
PER_TERM, PER_STEP = "per_term", "per_step"

# What a term gives: so many numbers, or one for each joint, action or upper-body joint.
_JOINTS, _ACTIONS, _UPPER_BODY = "joints", "actions", "upper body"
_TERMS: dict[str, int | str] = {
    "base_lin_vel": 3,
    "base_ang_vel": 3,
    "projected_gravity": 3,
    "velocity_command": 3,
    "linear_velocity_command": 2,
    "yaw_rate_command": 1,
    "walk_flag": 1,
    "stand_flag": 1,
    "base_height_command": 1,
    "waist_command": 3,
    "gait_phase": 2,
    "joint_pos": _JOINTS,
    "joint_pos_rel": _JOINTS,
    "joint_vel_rel": _JOINTS,
    "last_action": _ACTIONS,
    "upper_body_reference": _UPPER_BODY,
}


@dataclass(frozen=True)
class PolicyJoint:
    """A joint's angle (rad) where the action is zero, or that is held, and its servo."""

    name: str
    default_rad: float
    servo: Servo


@dataclass(frozen=True)
class Term:
    """One term of the observation: ``size`` numbers, clipped to ``clip``, times ``scale`` (size,)."""

    name: str
    size: int
    scale: np.ndarray
    clip: float
    period_s: float


@dataclass(frozen=True)
class Commands:
    """What a policy may be commanded; ``base_height_m`` None: it takes no height.

    Below ``slowest_m_s`` and ``slowest_turn_rad_s`` it stands instead of obeying.
    """

    vx_m_s: Range
    vy_m_s: Range
    yaw_rate_rad_s: Range
    base_height_m: Range | None
    walking_height_m: float
    slowest_m_s: float
    slowest_turn_rad_s: float


@dataclass(frozen=True)
class PolicyLayout:
    """How a policy's numbers relate to a robot.

    ``joints`` are in the order of the observation; ``actions`` (m,) int index those that the
    policy drives, in the order of its output; the others and ``held`` keep their angles.
    A target is default + ``action_scale`` (m,) * action, the action clipped to ``action_clip``;
    joints of ``upper_body``, a subset, add their reference's difference from the default.
    """

    name: str
    where: str
    rate_hz: float
    step_s: float
    joints: tuple[PolicyJoint, ...]
    held: tuple[PolicyJoint, ...]
    actions: np.ndarray
    action_scale: np.ndarray
    action_clip: float
    upper_body: tuple[tuple[str, float], ...]
    history: int
    history_order: str
    history_start: str
    terms: tuple[Term, ...]
    commands: Commands

    @property
    def observation_size(self) -> int:
        """Numbers the network takes: all terms, all steps of the history."""
        return self.history * sum(term.size for term in self.terms)

    @property
    def action_size(self) -> int:
        """Numbers the network gives."""
        return len(self.actions)

    @property
    def decimation(self) -> int:
        """Simulation steps from one action to the next."""
        return round(1.0 / (self.rate_hz * self.step_s))

    @property
    def default_rad(self) -> np.ndarray:
        """(joints,) float64."""
        return np.array([joint.default_rad for joint in self.joints])

    @staticmethod
    def load(source: str | Path) -> PolicyLayout:
        """Read a layout from a TOML file, or a shipped one by its name.

        Raises RobotError naming the file and the field: an unknown field, a value of another
        kind, size or range.
        """
        what = "observation layout (controller.layout)"
        reader, data = Reader.of(source, LAYOUTS, what, "docs/controllers.md", RobotError)
        return _layout(dataclasses.replace(reader, what="observation layout"), data)


_JOINT = "Write [name, angle in rad, stiffness, damping]."
_JointRow = tuple[str, float, float, float]


@dataclass(frozen=True)
class _TermRow:
    term: str = setting(choices=tuple(_TERMS))
    scale: float | tuple[float, ...] = 1.0
    clip: float = setting(math.inf, low=0.0)
    period_s: float | None = setting(None, low=0.05, high=60.0)


@dataclass(frozen=True)
class _History:
    length: int = setting(1, low=1, high=_MAX_HISTORY)
    order: str = setting(PER_TERM, choices=(PER_TERM, PER_STEP))
    start: str = setting("first", choices=("first", "zeros"))


@dataclass(frozen=True)
class _Action:
    scale: float | tuple[float, ...] = setting()
    joints: tuple[str, ...] | None = None
    clip: float = setting(math.inf, low=0.0)


@dataclass(frozen=True)
class _Commands:
    vx_m_s: Range = setting(low=-20.0, high=20.0)
    vy_m_s: Range = setting(low=-20.0, high=20.0)
    yaw_rate_rad_s: Range = setting(low=-20.0, high=20.0)
    base_height_m: Range | None = setting(None, low=0.05, high=5.0)
    walking_height_m: float | None = None
    slowest_m_s: float = 0.0
    slowest_turn_rad_s: float = 0.0


@dataclass(frozen=True)
class _File:
    """The tables of a layout's file, each checked for itself."""

    name: str
    rate_hz: float = setting(low=1.0, high=1000.0)
    step_s: float = setting(low=1e-4, high=0.02)
    joints: tuple[_JointRow, ...] = setting(form=_JOINT)
    observation: tuple[_TermRow, ...] = setting(form='Write rows { term = "base_ang_vel", scale = 1 }.')
    action: _Action = setting()
    commands: _Commands = setting()
    held: tuple[_JointRow, ...] = setting((), form=_JOINT)
    upper_body: tuple[tuple[str, float], ...] = setting((), form="Write rows [one of the joints, angle].")
    history: _History = _History()


def _layout(reader: Reader, data: Mapping[str, Any]) -> PolicyLayout:
    """The layout that a file's tables say, checked for what they have to keep to together."""
    file = reader.table(_File, {"name": reader.where.stem, **data})
    names = [row[0] for row in file.joints]
    every = names + [row[0] for row in file.held]
    if not names:
        raise reader.wrong("joints", "are none", "Name the policy's joints in its order.")
    if repeated := next((name for name in every if every.count(name) > 1), None):
        raise reader.wrong("joints", f"name {repeated} twice", "Name each joint once.")
    if any(name not in names for name, _ in file.upper_body):
        raise reader.wrong("upper_body", "is not understood", "Write rows [one of the joints, angle].")
    acting = names if file.action.joints is None else file.action.joints
    if not acting or any(name not in names for name in acting):
        raise reader.wrong("action.joints", "are not all among the joints", "Name some of them.")
    ratio = 1.0 / (file.rate_hz * file.step_s)
    if abs(ratio - round(ratio)) > 1e-3 or round(ratio) < 1:
        raise reader.wrong("step_s", f"is {file.step_s:g}", "The policy's period is a whole number of steps.")
    sizes = {_JOINTS: len(names), _ACTIONS: len(acting), _UPPER_BODY: len(file.upper_body)}
    if not file.observation:
        raise reader.wrong("observation", "has no terms", "Write what the policy observes.")
    terms = tuple(_term(reader, f"observation[{i}]", row, sizes) for i, row in enumerate(file.observation))
    return PolicyLayout(
        name=file.name,
        where=str(reader.where),
        rate_hz=file.rate_hz,
        step_s=file.step_s,
        joints=_joints(reader, "joints", file.joints),
        held=_joints(reader, "held", file.held),
        actions=np.array([names.index(name) for name in acting]),
        action_scale=_each(reader, "action.scale", file.action.scale, len(acting)),
        action_clip=file.action.clip,
        upper_body=file.upper_body,
        history=file.history.length,
        history_order=file.history.order,
        history_start=file.history.start,
        terms=terms,
        commands=_commands(reader, file.commands, {term.name for term in terms}),
    )


def _joints(reader: Reader, field: str, rows: Sequence[_JointRow]) -> tuple[PolicyJoint, ...]:
    for index, row in enumerate(rows):
        if min(row[2:]) < 0.0:
            raise reader.wrong(f"{field}[{index}]", f"is {list(row)}", _JOINT)
    return tuple(PolicyJoint(name, angle, Servo(*servo)) for name, angle, *servo in rows)


def _term(reader: Reader, place: str, row: _TermRow, sizes: Mapping[str, int]) -> Term:
    given = _TERMS[row.term]
    size = given if isinstance(given, int) else sizes[given]
    if size == 0:
        raise reader.wrong(place, f"is {row.term} of no joints", f"Declare the {given}.")
    if row.term == "gait_phase" and row.period_s is None:
        raise reader.wrong(f"{place}.period_s", "is missing", "Write seconds.")
    if row.term != "gait_phase" and row.period_s is not None:
        raise reader.wrong(f"{place}.period_s", "is no field of this term", "Remove it.")
    period_s = math.nan if row.period_s is None else row.period_s
    return Term(row.term, size, _each(reader, f"{place}.scale", row.scale, size), row.clip, period_s)


def _each(reader: Reader, place: str, value: float | tuple[float, ...], count: int) -> np.ndarray:
    """One number for all, or one each: (count,) float64."""
    numbers = value if isinstance(value, tuple) else (value,) * count
    if len(numbers) != count:
        raise reader.wrong(place, f"is {list(numbers)}", f"Write one finite number, or a list of {count}.")
    return np.array(numbers, np.float64)


def _commands(reader: Reader, table: _Commands, terms: set[str]) -> Commands:
    moves = {"vx_m_s": table.vx_m_s, "vy_m_s": table.vy_m_s, "yaw_rate_rad_s": table.yaw_rate_rad_s}
    for field, (low, high) in moves.items():
        if not low <= 0.0 <= high:
            raise reader.wrong(f"commands.{field}", "leaves out 0", "A policy has to stand, too.")
    if table.vx_m_s[1] <= 0.0:
        raise reader.wrong("commands.vx_m_s", "is never positive", "The robot has to walk ahead.")
    slowest = {"slowest_m_s": (0.0, table.vx_m_s[1]), "slowest_turn_rad_s": (0.0, table.yaw_rate_rad_s[1])}
    height = table.base_height_m
    if "base_height_command" not in terms and height is not None:
        raise reader.wrong("commands.base_height_m", "is not observed", "Remove it, or add the term.")
    limits = slowest if height is None else slowest | {"walking_height_m": height}
    if "base_height_command" in terms and height is None:
        raise reader.wrong("commands.base_height_m", "is missing", "Write a range [low, high].")
    for field, (low, high) in limits.items():
        value = getattr(table, field)
        if value is None or not low <= value <= high:
            shown = "is missing" if value is None else f"is {value!r}"
            raise reader.wrong(f"commands.{field}", shown, f"It lies from {low:g} to {high:g}.")
    walking = math.nan if height is None else table.walking_height_m
    assert walking is not None  # as looked at above
    return Commands(
        table.vx_m_s, table.vy_m_s, table.yaw_rate_rad_s, height, walking, table.slowest_m_s, table.slowest_turn_rad_s
    )
