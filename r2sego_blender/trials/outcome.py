"""What a trial ends in, and why."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Outcome(Enum):
    """An unusable trial counts neither way: the same is tried again."""

    SUCCESS = "success"
    FAILURE = "failure"
    UNUSABLE = "unusable"


class Failure(Enum):
    """Why the robot failed (Sec. "Real-Robot Sitting Validation")."""

    INTERVENTION = "intervention"
    TETHER = "load-bearing tether"
    EMERGENCY_STOP = "emergency stop"
    NO_SUPPORT = "no stable support by the chair"
    TIMEOUT = "out of time"
    OBSERVED = "seen by a person"


class Unusable(Enum):
    """Why a recording tells nothing of the robot."""

    GAP = "gap in the samples"
    LOSS = "samples lost"
    SATURATION = "saturated channel"
    SENSOR_FAULT = "sensor fault"
    RESET = "device reset"
    CLOCK_DRIFT = "clock drift"
    SILENCE = "silence"
    DISCONNECTED = "line lost"
    CALIBRATION = "calibration out of date"
    CUT_OFF = "recording cut off"
    ABORTED = "ended by the operator"


@dataclass(frozen=True)
class Judgement:
    """An ``outcome`` with its ``reasons``, each a kind with what was measured, in words.

    ``manual`` is whose judgement it is where a person gave it, else "". ``support_s`` is the longest stable
    support by the chair, ``highest_tether_n`` the most the tether bore, NaN where nothing measured them.
    """

    outcome: Outcome
    reasons: tuple[tuple[Failure | Unusable, str], ...]
    support_s: float
    highest_tether_n: float
    manual: str = ""
