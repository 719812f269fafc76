"""Reading the record of one trial, finished or cut off: all up to the last whole chunk."""

from __future__ import annotations

import contextlib
import io
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, Footer, McapRecord, Message, Metadata
from mcap.stream_reader import StreamReader, breakup_chunk

from ...core.errors import TrialError, may_not_be_read
from ...core.json_files import parse_json
from ...core.text_files import read_bytes
from ..events import EventKind, TrialEvent
from ..outcome import Judgement
from .judgement_values import judgement_of
from .writing import EVENTS, JUDGEMENT, LOST, METADATA, RECEIVED

MOST_BYTES = 512 << 20
"""Of a record: an hour at 1 kHz."""

_MOST_MESSAGES, _MOST_TOLD, _MOST_RECORD_BYTES = 2_000_000, 20_000, 8 << 20
_END = (McapError, struct.error, ValueError, OverflowError, LookupError)  # where a file was cut off or damaged
_LATEST_NS = 1 << 63


class Piece(NamedTuple):
    """Bytes as they came, when by this machine's monotonic clock, and when by the wall clock."""

    data: bytes
    received_ns: int
    wall_ns: int


@dataclass(frozen=True)
class Record:
    """What one record holds.

    ``about`` are the JSON values that it began with, ``lost_ns`` when the line was lost, ``judgements`` are in
    their order; ``finished`` is whether the file was, and nothing in it damaged.
    """

    file: Path
    about: Mapping[str, Any]
    received: tuple[Piece, ...]
    events: tuple[TrialEvent, ...]
    lost_ns: tuple[int, ...]
    judgements: tuple[Judgement, ...]
    finished: bool

    @property
    def complete(self) -> bool:
        """Whether all that was judged is in it: a judgement stands behind that."""
        return bool(self.judgements)


def read_record(file: Path) -> Record:
    """The record in ``file``. Raises TrialError where there is none, or it is larger than any."""
    try:
        data = read_bytes(file, MOST_BYTES)
    except PermissionError as error:
        raise may_not_be_read(file, TrialError) from error
    except (OSError, ValueError) as error:
        raise _no_record(file, str(error)) from error
    about: Mapping[str, Any] | None = None
    topics: dict[int, str] = {}
    received: list[Piece] = []
    events: list[TrialEvent] = []
    lost: list[int] = []
    judgements: list[Judgement] = []
    finished = False
    for record in _records(data):
        if isinstance(record, Metadata) and record.name == METADATA and about is None:
            about = _about(record, file)
        elif isinstance(record, Channel):
            topics[record.id] = record.topic
        elif isinstance(record, Footer):
            finished = True
        elif isinstance(record, Message) and max(record.publish_time, record.log_time) < _LATEST_NS:
            topic = topics.get(record.channel_id)
            if topic == RECEIVED and record.data:
                received.append(Piece(record.data, record.publish_time, record.log_time))
            elif topic == LOST and len(lost) < _MOST_TOLD:
                lost.append(record.publish_time)
            elif topic in (EVENTS, JUDGEMENT) and len(events) + len(judgements) < _MOST_TOLD:
                with contextlib.suppress(ValueError, LookupError, TypeError):
                    values = parse_json(record.data.decode())
                    if topic == JUDGEMENT:
                        judgements.append(judgement_of(values))
                    else:
                        events.append(_event(values, record))
    if about is None:
        raise _no_record(file, "it does not say which trial it is of")
    return Record(file, about, tuple(received), tuple(events), tuple(lost), tuple(judgements), finished)


def _records(data: bytes) -> Iterator[McapRecord]:
    """Those up to the first that is cut off or damaged."""
    reader = StreamReader(io.BytesIO(data), emit_chunks=True, validate_crcs=True, record_size_limit=_MOST_RECORD_BYTES)
    messages = 0
    with contextlib.suppress(*_END):
        for record in reader.records:
            # Packed chunks could become any size; none of ours is packed.
            if isinstance(record, Chunk) and (record.compression or len(record.data) != record.uncompressed_size):
                return
            within = breakup_chunk(record, validate_crc=True) if isinstance(record, Chunk) else [record]
            messages += len(within)
            if messages > _MOST_MESSAGES:
                return
            yield from within


def _about(record: Metadata, file: Path) -> Mapping[str, Any]:
    try:
        about = parse_json(record.metadata["json"])
    except (ValueError, LookupError) as error:
        raise _no_record(file, str(error)) from error
    if not isinstance(about, dict):
        raise _no_record(file, "what it is of is no table")
    return about


def _event(values: Mapping[str, Any], record: Message) -> TrialEvent:
    text = values["text"]
    if not isinstance(text, str):
        raise ValueError("an event's words are no text")
    return TrialEvent(EventKind(values["kind"]), record.publish_time, text, record.log_time)


def _no_record(file: Path, why: str) -> TrialError:
    return TrialError(f"this is no record of a trial: {why}", where=file, cure="Give one of a study's records.")
