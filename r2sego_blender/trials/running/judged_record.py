"""A trial's judgement from its record alone, whenever it is asked for: the same each time."""

from __future__ import annotations

import dataclasses

from ..judging.judge import judge
from ..line.decoding import StreamBuilder
from ..outcome import Judgement, Outcome
from ..records.index import CUT_OFF
from ..records.reading import Record
from ..stream import Stream
from .about import About


def stream_of(record: Record) -> Stream:
    """What the device sent, decoded anew of the bytes as they came. Raises TrialError: it says no device."""
    about = About.of(record)
    builder, decoder = StreamBuilder(about.hello), about.adapter.decoder()
    for piece in record.received:
        builder.add(decoder.feed(piece.data, piece.received_ns), piece.received_ns)
    for lost_ns in record.lost_ns:
        builder.lost(lost_ns)
    return builder.stream()


def judged_record(record: Record, is_over: bool = False) -> Judgement:
    """The sensors' judgement. A record that was cut off is unusable, unless it ``is_over`` and still open.

    Raises TrialError: what it is of is damaged.
    """
    about = About.of(record)
    judgement = judge(stream_of(record), record.events, about.calibration, about.rules)
    if is_over or record.complete:
        return judgement
    return dataclasses.replace(judgement, outcome=Outcome.UNUSABLE, reasons=(*CUT_OFF.reasons, *judgement.reasons))
