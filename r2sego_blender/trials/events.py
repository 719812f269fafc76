"""What happens at a trial beside its signals: who started, touched or ended it, and when."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class EventKind(Enum):
    """What an event tells; only those between the start and the end of a trial are judged."""

    STARTED = "started"
    """The policy acts from here on."""

    ENDED = "ended"
    """What comes later is not judged."""

    INTERVENTION = "intervention"
    """The operator held, pushed or steered the robot: a failure."""

    EMERGENCY_STOP = "emergency stop"
    """Told by the operator; a device tells it with its flags."""

    ABORTED = "aborted"
    """The operator calls the trial off, whatever the robot did: unusable."""

    VIDEO = "video"
    """A camera shows this moment, as by a clap or a lamp; the words say which."""

    NOTE = "note"
    """The operator's words; they change no judgement."""


@dataclass(frozen=True)
class TrialEvent:
    """An event at ``time_ns`` of the clock that stamps samples (``Stream.received_ns``), with words to it.

    ``wall_ns`` is the same moment since 1970, UTC; of the start it is the trial's date, 0 where unknown.
    """

    kind: EventKind
    time_ns: int
    text: str = ""
    wall_ns: int = 0
