"""The declared observation layout of a learned policy (docs/controllers.md lists its fields)."""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...config.declared_files import read_declaration
from ...core.errors import RobotError
from ..model.humanoid import Servo
from ..scope.scope import LAYOUTS, Range

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
        path, data = read_declaration(source, LAYOUTS, what, "docs/controllers.md")
        return _Reader(path).layout(data)


_REQUIRED = object()
_FIELDS = (
    "name", "rate_hz", "step_s", "joints", "held", "upper_body", "observation", "history", "action",
    "commands",
)  # fmt: skip


@dataclass(frozen=True)
class _Reader:
    path: Path

    def layout(self, data: dict[str, Any]) -> PolicyLayout:
        self._known(data, "", _FIELDS)
        joints = self._joints(data, "joints")
        held = self._joints(data, "held")
        names = [joint.name for joint in joints]
        every = names + [joint.name for joint in held]
        if not joints:
            raise self._error("joints", "is missing", "Name the policy's joints in its order.")
        if repeated := next((name for name in every if every.count(name) > 1), None):
            raise self._error("joints", f"name {repeated} twice", "Name each joint once.")
        upper_body = self._upper_body(data, names)
        action = self._table(data, "action", ("joints", "scale", "clip"))
        acting = action.get("joints", names)
        if not isinstance(acting, list) or not acting or any(name not in names for name in acting):
            raise self._error("action.joints", "are not all among the joints", "Name some of them.")
        history = self._table(data, "history", ("length", "order", "start"))
        length = self._number(history, "history", "length", 1, _MAX_HISTORY, 1)
        if length != int(length):
            raise self._error("history.length", f"is {length}", "Write a whole number.")
        rate_hz = self._number(data, "", "rate_hz", 1.0, 1000.0)
        step_s = self._number(data, "", "step_s", 1e-4, 0.02)
        ratio = 1.0 / (rate_hz * step_s)
        if abs(ratio - round(ratio)) > 1e-3 or round(ratio) < 1:
            raise self._error("step_s", f"is {step_s:g}", "The policy's period is a whole number of steps.")
        sizes = {_JOINTS: len(joints), _ACTIONS: len(acting), _UPPER_BODY: len(upper_body)}
        terms = self._terms(data, sizes)
        return PolicyLayout(
            name=self._text(data, "", "name", self.path.stem),
            where=str(self.path),
            rate_hz=rate_hz,
            step_s=step_s,
            joints=joints,
            held=held,
            actions=np.array([names.index(name) for name in acting]),
            action_scale=self._numbers(action, "action", "scale", len(acting), _REQUIRED),
            action_clip=self._number(action, "action", "clip", 0.0, math.inf, math.inf),
            upper_body=upper_body,
            history=int(length),
            history_order=self._text(history, "history", "order", PER_TERM, (PER_TERM, PER_STEP)),
            history_start=self._text(history, "history", "start", "first", ("first", "zeros")),
            terms=terms,
            commands=self._commands(data, {term.name for term in terms}),
        )

    def _joints(self, data: dict[str, Any], field: str) -> tuple[PolicyJoint, ...]:
        rows = data.get(field, [])
        if not isinstance(rows, list):
            raise self._error(field, "is no list", "Write rows [name, angle, stiffness, damping].")
        joints = []
        for index, row in enumerate(rows):
            is_row = isinstance(row, list) and len(row) == 4 and isinstance(row[0], str)
            if not is_row or not all(map(_is_number, row[1:])) or min(row[2:]) < 0.0:
                raise self._error(
                    f"{field}[{index}]", f"is {row!r}", "Write [name, angle in rad, stiffness, damping]."
                )
            angle, stiffness, damping = map(float, row[1:])
            joints.append(PolicyJoint(row[0], angle, Servo(stiffness, damping)))
        return tuple(joints)

    def _upper_body(self, data: dict[str, Any], names: list[str]) -> tuple[tuple[str, float], ...]:
        rows = data.get("upper_body", [])
        if not isinstance(rows, list) or not all(
            isinstance(row, list) and len(row) == 2 and row[0] in names and _is_number(row[1]) for row in rows
        ):
            raise self._error("upper_body", "is not understood", "Write rows [one of the joints, angle].")
        return tuple((str(name), float(angle)) for name, angle in rows)

    def _terms(self, data: dict[str, Any], sizes: dict[str, int]) -> tuple[Term, ...]:
        rows = data.get("observation")
        if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
            raise self._error("observation", "is missing", 'Write rows { term = "base_ang_vel", scale = 1 }.')
        terms = []
        for index, row in enumerate(rows):
            place = f"observation[{index}]"
            self._known(row, f"{place}.", ("term", "scale", "clip", "period_s"))
            name = self._text(row, place, "term", _REQUIRED, tuple(_TERMS))
            given = _TERMS[name]
            size = given if isinstance(given, int) else sizes[given]
            if size == 0:
                raise self._error(place, f"is {name} of no joints", f"Declare the {given}.")
            period_s = math.nan
            if name == "gait_phase":
                period_s = self._number(row, place, "period_s", 0.05, 60.0)
            elif "period_s" in row:
                raise self._error(f"{place}.period_s", "is no field of this term", "Remove it.")
            clip = self._number(row, place, "clip", 0.0, math.inf, math.inf)
            terms.append(Term(name, size, self._numbers(row, place, "scale", size, 1.0), clip, period_s))
        return tuple(terms)

    def _commands(self, data: dict[str, Any], terms: set[str]) -> Commands:
        fields = (
            "vx_m_s", "vy_m_s", "yaw_rate_rad_s", "base_height_m", "walking_height_m", "slowest_m_s",
            "slowest_turn_rad_s",
        )  # fmt: skip
        table = self._table(data, "commands", fields)
        vx, vy, yaw_rate = (self._range(table, field, -20.0, 20.0) for field in fields[:3])
        for field, (low, high) in zip(fields, (vx, vy, yaw_rate), strict=False):
            if not low <= 0.0 <= high:
                raise self._error(f"commands.{field}", "leaves out 0", "A policy has to stand, too.")
        if vx[1] <= 0.0:
            raise self._error("commands.vx_m_s", "is never positive", "The robot has to walk ahead.")
        slowest = (
            self._number(table, "commands", "slowest_m_s", 0.0, vx[1], 0.0),
            self._number(table, "commands", "slowest_turn_rad_s", 0.0, max(yaw_rate[1], 0.0), 0.0),
        )
        if "base_height_command" not in terms:
            if "base_height_m" in table:
                raise self._error("commands.base_height_m", "is not observed", "Remove it, or add the term.")
            return Commands(vx, vy, yaw_rate, None, math.nan, *slowest)
        height = self._range(table, "base_height_m", 0.05, 5.0)
        walking = self._number(table, "commands", "walking_height_m", *height)
        return Commands(vx, vy, yaw_rate, height, walking, *slowest)

    def _table(self, data: dict[str, Any], field: str, known: tuple[str, ...]) -> dict[str, Any]:
        table = data.get(field, {})
        if not isinstance(table, dict):
            raise self._error(field, "is not a table", f"Write [{field}] and its fields below.")
        self._known(table, f"{field}.", known)
        return table

    def _known(self, table: dict[str, Any], prefix: str, known: tuple[str, ...] | list[str]) -> None:
        for key in table:
            if key not in known:
                close = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
                cure = f"Did you mean {close[0]}?" if close else f"Known: {', '.join(known)}."
                raise self._error(f"{prefix}{key}", "is not a field of an observation layout", cure)

    def _text(
        self, table: dict[str, Any], place: str, field: str, default: Any, choices: tuple[str, ...] = ()
    ) -> str:
        place = f"{place}.{field}" if place else field
        value = table.get(field, default)
        if not isinstance(value, str) or not value or (choices and value not in choices):
            cure = f"Give one of: {', '.join(choices)}." if choices else "Write a text."
            raise self._error(place, "is missing" if value is _REQUIRED else f"is {value!r}", cure)
        return value

    def _number(
        self, table: dict[str, Any], place: str, field: str, low: float, high: float, default: Any = _REQUIRED
    ) -> float:
        place = f"{place}.{field}" if place else field
        value = table.get(field, default)
        if value is _REQUIRED:
            raise self._error(place, "is missing", "Write a number.")
        if value is not default and not _is_number(value):
            raise self._error(place, f"is {value!r}", "Write a finite number.")
        if not low <= value <= high:
            raise self._error(place, f"is {value!r}", f"It lies from {low:g} to {high:g}.")
        return float(value)

    def _numbers(self, table: dict[str, Any], place: str, field: str, count: int, default: Any) -> np.ndarray:
        """One number for all, or one each: (count,) float64."""
        value = table.get(field, default)
        numbers = value if isinstance(value, list) else [value] * count
        if len(numbers) != count or not all(map(_is_number, numbers)):
            shown = "is missing" if value is _REQUIRED else f"is {value!r}"
            raise self._error(f"{place}.{field}", shown, f"Write one finite number, or a list of {count}.")
        return np.array(numbers, np.float64)

    def _range(self, table: dict[str, Any], field: str, low: float, high: float) -> Range:
        value: Any = table.get(field)
        is_range = isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))
        if not is_range or not low <= value[0] <= value[1] <= high:
            raise self._error(
                f"commands.{field}", "is missing" if value is None else f"is {value!r}",
                f"Write [low, high] within {low:g} and {high:g}.",
            )  # fmt: skip
        return float(value[0]), float(value[1])

    def _error(self, field: str, what: str, cure: str) -> RobotError:
        return RobotError(f"{field} {what}", where=self.path, cure=cure)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
