"""What an operator sees of a session, ten times a second: as an object, and as JSON for Blender.

Standard library alone.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from ..outcome import Outcome

LIVE_EVENT = "live"
"""The kind of the job's events (``core/progress.py``) that carry a ``Live``."""

Pose = tuple[float, float, float]
"""x and y in metres, and the heading in degrees counter-clockwise from the x axis."""

_LONGEST, _MOST = 600, 64


class State(Enum):
    """Where a session stands; a trial is recorded from ``ARMED`` until it is ``JUDGED``."""

    WAITING = "waiting for the device"
    SELF_TEST = "self-test"
    SET_UP = "set up"
    ARMED = "armed"
    RUNNING = "running"
    ENDED = "ended"
    JUDGED = "judged"
    FINISHED = "finished"


@dataclass(frozen=True)
class Counts:
    """Judged trials of one condition: ``successes`` of ``trials``, and those ``unusable`` beside them."""

    condition: str
    successes: int
    trials: int
    unusable: int


@dataclass(frozen=True)
class Live:
    """A session at a moment.

    ``next`` is what the operator has to do, in words, ``record`` the number of the record being written (0:
    none). ``index`` of ``total`` planned trials is this one, from 0, ``label`` what the operator may know of its
    policy, ``repetition`` its number of the policy's, from 0; ``tethered`` whether the tether stays on.
    ``robot_pose`` and ``chair_pose`` are to be set up, with a ``chair`` of this type. ``newtons`` are by channel,
    NaN without a calibration; ``rate_hz`` and ``lost_share`` are the last second's. ``elapsed_s`` counts from the
    trial's start, ``support_s`` is the support by the chair so far. ``outcome`` and ``reasons`` are the last
    trial's; ``counts`` are None while they are hidden from a blinded operator.
    """

    state: State
    next: str
    index: int
    total: int
    label: str
    repetition: int
    tethered: bool
    robot_pose: Pose
    chair_pose: Pose
    chair: str
    record: int = 0
    newtons: tuple[tuple[str, float], ...] = ()
    rate_hz: float = 0.0
    lost_share: float = 0.0
    emergency_stop: bool = False
    elapsed_s: float = 0.0
    support_s: float = 0.0
    outcome: Outcome | None = None
    reasons: tuple[str, ...] = ()
    counts: tuple[Counts, ...] | None = None
    simulated: bool = False

    def to_json(self) -> dict[str, Any]:
        """JSON values, from which ``from_json`` makes it again; null for numbers that are none."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        values["state"] = self.state.name
        values["outcome"] = None if self.outcome is None else self.outcome.name
        values["newtons"] = {name: value if math.isfinite(value) else None for name, value in self.newtons}
        values["counts"] = None if self.counts is None else [dataclasses.asdict(one) for one in self.counts]
        return values

    @staticmethod
    def from_json(values: Mapping[str, Any]) -> Live:
        """Of an event's data. Raises ValueError for what ``to_json`` does not give."""
        try:
            newtons, reasons, counts = values["newtons"], values["reasons"], values["counts"]
            if max(map(len, (newtons, reasons, counts or ()))) > _MOST:
                raise ValueError("it has too many values")
            plain: dict[str, Any] = {
                **{name: _text(values[name]) for name in ("next", "label", "chair")},
                **{name: _whole(values[name]) for name in ("index", "total", "repetition", "record")},
                **{name: _number(values[name]) for name in ("rate_hz", "lost_share", "elapsed_s", "support_s")},
                **{name: bool(values[name]) for name in ("tethered", "emergency_stop", "simulated")},
            }
            return Live(
                state=State[values["state"]],
                outcome=None if values["outcome"] is None else Outcome[values["outcome"]],
                newtons=tuple((_text(name), _number(value)) for name, value in newtons.items()),
                reasons=tuple(map(_text, reasons)),
                counts=None if counts is None else tuple(map(_counts, counts)),
                robot_pose=_pose(values["robot_pose"]),
                chair_pose=_pose(values["chair_pose"]),
                **plain,
            )
        except (LookupError, TypeError, AttributeError, ArithmeticError) as error:
            raise ValueError(f"this is no state of a session: {error}") from error


def _counts(values: Mapping[str, Any]) -> Counts:
    numbers = {name: _whole(values[name]) for name in ("successes", "trials", "unusable")}
    return Counts(_text(values["condition"]), **numbers)


def _pose(values: Any) -> Pose:
    x, y, turn = map(_number, values)
    return x, y, turn


def _whole(value: Any) -> int:
    if not isinstance(value, int) or not 0 <= value < 1 << 31:
        raise ValueError("it counts nothing")
    return value


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


def _text(value: Any) -> str:
    return str(value)[:_LONGEST]
