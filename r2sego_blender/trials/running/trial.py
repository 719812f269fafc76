"""The course of one trial while it is recorded: armed, running, ended, judged; and its record."""

from __future__ import annotations

import dataclasses

from ...core.digests import content_digest
from ...core.errors import TrialError
from ..events import EventKind
from ..judging.manual import manual_judgement
from ..line.decoding import Sample
from ..line.device import Received
from ..outcome import Judgement
from ..records.index import RecordIndex, file_name
from ..records.reading import read_record
from ..records.writing import EVENTS, HELLO, LOST, RecordWriter
from ..stream import Hello
from .about import About
from .clock import Clock
from .connection import Heard
from .controls import Control, Told
from .judged_record import judged_record
from .live import State

TAIL_S = 0.3
"""Recorded after a trial's end, so that a silence at its end is seen."""

_FLUSH_NS = 250_000_000
_EVENTS = {
    Control.INTERVENE: EventKind.INTERVENTION,
    Control.ABORT: EventKind.ABORTED,
    Control.NOTE: EventKind.NOTE,
    Control.VIDEO: EventKind.VIDEO,
}


class Trial:
    """One trial, from when it is armed; ``state`` says where it stands, ``refused`` why what was told counts not.

    What is heard of the line is recorded from the ``rest`` of its line until shortly after the trial's end, what
    the operator tells until it is closed.
    The record's file and its line in ``index`` are there before this is. Raises OSError.
    """

    def __init__(self, about: About, index: RecordIndex, clock: Clock, rest: Received) -> None:
        self.about = about
        self.state = State.ARMED
        self.judgement: Judgement | None = None
        self.refused = ""
        self._index, self._clock = index, clock
        self.file = index.folder / file_name(about.number)
        self._writer = RecordWriter(self.file, about.to_json())
        self._writer.received(*rest)
        self._started_ns = self._ended_ns = self._flushed_ns = clock.monotonic_ns()

    @property
    def elapsed_s(self) -> float:
        """Since its start, until its end."""
        if self.state is State.ARMED:
            return 0.0
        until_ns = self._clock.monotonic_ns() if self.state is State.RUNNING else self._ended_ns
        return (until_ns - self._started_ns) / 1e9

    def hear(self, heard: Heard) -> None:
        """Record what came, and go on by the clock."""
        if self.state is not State.JUDGED:
            self._record(heard)
        now_ns = self._clock.monotonic_ns()
        if self.state is State.RUNNING and self.elapsed_s >= self.about.rules.timeout_s:
            self._end()
        elif self.state is State.ENDED and (heard.lost or now_ns - self._ended_ns >= TAIL_S * 1e9):
            self._judge()
        elif now_ns - self._flushed_ns >= _FLUSH_NS:
            self._writer.flush()
            self._flushed_ns = now_ns

    def tell(self, told: Told) -> None:
        """What the operator did; what has no sense in this state is passed over."""
        control, state = told.control, self.state
        if control is Control.START and state is State.ARMED:
            self.state = State.RUNNING
            self._started_ns = self._event(EventKind.STARTED)
        elif control is Control.END and state is State.RUNNING:
            self._end()
        elif control in (Control.NOTE, Control.VIDEO) or (control is Control.INTERVENE and state is State.RUNNING):
            self._event(_EVENTS[control], told.text())
        elif control in (Control.ABORT, Control.STOP) and state in (State.ARMED, State.RUNNING):
            self._event(EventKind.ABORTED, told.text())
            self._end()
        elif control is Control.ABORT:  # its reason was typed while the trial came to its end
            self._event(EventKind.NOTE, told.text())
            self.refused = "It had ended before it was called off: judge it by hand. Why stands in a note."
        elif control is Control.JUDGE and state is State.JUDGED and self.judgement is not None:
            self._judge_by_hand(self.judgement, told)

    def _judge_by_hand(self, judgement: Judgement, told: Told) -> None:
        try:
            self._count(manual_judgement(judgement, told.text("outcome"), told.text("by"), told.text()))
            self.refused = ""
        except TrialError as error:  # a word that was mistyped ends no session
            self.refused = str(error)

    def close(self) -> None:
        """Finish the record. One that is not over is left as it is: cut off."""
        if self.state is State.JUDGED:
            self._writer.close()
            self._index.close(self.about.number, content_digest(self.file))

    def _record(self, heard: Heard) -> None:
        for received in heard.received:
            self._writer.received(*received)
        if heard.received:
            *_, received_ns, wall_ns = heard.received[-1]
            samples = [message for message in heard.messages if isinstance(message, Sample)]
            self._writer.samples(samples, received_ns, wall_ns)
            for message in heard.messages:
                if isinstance(message, Hello):
                    self._writer.tell(HELLO, dataclasses.asdict(message), received_ns, wall_ns)
        if heard.lost:
            self._writer.tell(LOST, {"text": heard.lost}, self._clock.monotonic_ns(), self._clock.wall_ns())
            if self.state is not State.ENDED:
                self._end()

    def _event(self, kind: EventKind, text: str = "") -> int:
        now_ns = self._clock.monotonic_ns()
        self._writer.tell(EVENTS, {"kind": kind.value, "text": text}, now_ns, self._clock.wall_ns())
        return now_ns

    def _end(self) -> None:
        self._ended_ns = self._event(EventKind.ENDED)
        self.state = State.ENDED

    def _judge(self) -> None:
        """By the record as it lies there, so that it comes out the same whenever it is asked again."""
        self._writer.flush()
        self._count(judged_record(read_record(self.file), is_over=True))
        self.state = State.JUDGED

    def _count(self, judgement: Judgement) -> None:
        self._writer.judgement(judgement, self._clock.monotonic_ns(), self._clock.wall_ns())
        self._index.judge(self.about.number, judgement)
        self.judgement = judgement
