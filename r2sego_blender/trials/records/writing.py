"""Writing the record of one trial: an MCAP file of which a kill leaves all but its last chunk.

Topics: ``received`` has the bytes as the line gave them; ``samples`` what was decoded of them, for other
programs; ``hello``, ``events``, ``lost`` (the line was lost) and ``judgement`` are JSON. The log time of each message
is the wall clock, as other recordings of the robot have it, its publish time this machine's monotonic clock, by
which trials are judged; both in nanoseconds. What the trial is stands in the metadata ``trial``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mcap.writer

from ..line.decoding import Sample
from ..outcome import Judgement
from .judgement_values import judgement_values

CHUNK_BYTES = 16 << 10
"""The most that a kill can cost."""

RECEIVED, SAMPLES, HELLO, EVENTS, LOST, JUDGEMENT = "received", "samples", "hello", "events", "lost", "judgement"
METADATA = "trial"

_PIECE_BYTES = CHUNK_BYTES // 4  # a message, with which a chunk grows beyond where it is closed
_PIECE_SAMPLES = 32  # of 8 channels: 4 kB
_WHOLE: Mapping[str, Any] = {"type": "integer"}
_LIST = {"type": "array", "items": _WHOLE}
_SCHEMAS: Mapping[str, Mapping[str, Any]] = {
    SAMPLES: {  # a list each; raw has a list of the channels' counts for each sample
        "sequence": _LIST,
        "device_us": _LIST,
        "raw": {"type": "array", "items": _LIST},
        "flags": _LIST,
    },
    HELLO: {"device": {"type": "string"}, "boot": _WHOLE, "rate_hz": {"type": "number"}},
    EVENTS: {"kind": {"type": "string"}, "text": {"type": "string"}},
    LOST: {"text": {"type": "string"}},
    JUDGEMENT: {"outcome": {"type": "string"}, "reasons": {"type": "array"}, "manual": {"type": "string"}},
}


class RecordWriter:
    """Writes a record to ``file``, which must not be there; ``about`` are JSON values of what it is of.

    ``flush`` bounds what a kill costs in time; without it the last chunk of at most 16 KiB. Raises OSError.
    """

    def __init__(self, file: Path, about: Mapping[str, Any]) -> None:
        self._stream = file.open("xb")
        self._writer = mcap.writer.Writer(
            self._stream,
            chunk_size=CHUNK_BYTES - 2 * _PIECE_BYTES,
            compression=mcap.writer.CompressionType.NONE,  # a reader's memory is then bounded by the file
            enable_data_crcs=True,
        )
        self._writer.start(library="r2sego")
        self._topics = {RECEIVED: self._writer.register_channel(RECEIVED, "application/octet-stream", 0)}
        for topic, schema in _SCHEMAS.items():
            schema_id = self._writer.register_schema(
                topic, "jsonschema", json.dumps(_json_schema(topic, schema)).encode()
            )
            self._topics[topic] = self._writer.register_channel(topic, "json", schema_id)
        self._writer.add_metadata(METADATA, {"json": json.dumps(about, allow_nan=False)})
        self.flush()

    def received(self, data: bytes, received_ns: int, wall_ns: int) -> None:
        """Bytes as they came."""
        for begin in range(0, len(data), _PIECE_BYTES):
            self._add(RECEIVED, data[begin : begin + _PIECE_BYTES], received_ns, wall_ns)

    def samples(self, samples: Sequence[Sample], received_ns: int, wall_ns: int) -> None:
        """What was decoded of them, as the device sent it."""
        for begin in range(0, len(samples), _PIECE_SAMPLES):
            piece = samples[begin : begin + _PIECE_SAMPLES]
            values = {
                "sequence": [one.sequence for one in piece],
                "device_us": [one.device_us for one in piece],
                "raw": [one.raw for one in piece],
                "flags": [one.flags for one in piece],
            }
            self._add(SAMPLES, json.dumps(values, separators=(",", ":")).encode(), received_ns, wall_ns)

    def tell(self, topic: str, values: Mapping[str, Any], received_ns: int, wall_ns: int) -> None:
        """A hello, an event or the line's loss; it is written at once."""
        self._add(topic, json.dumps(values, allow_nan=False).encode(), received_ns, wall_ns)
        self.flush()

    def judgement(self, judgement: Judgement, received_ns: int, wall_ns: int) -> None:
        """How it was judged; the last one counts."""
        self.tell(JUDGEMENT, judgement_values(judgement), received_ns, wall_ns)

    def flush(self) -> None:
        """Close the chunk and give it to the system, which keeps it whatever becomes of this process."""
        self._writer.flush()

    def close(self) -> None:
        """Finish the file and have the disk take it."""
        self._writer.finish()
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._stream.close()

    def _add(self, topic: str, data: bytes, received_ns: int, wall_ns: int) -> None:
        self._writer.add_message(self._topics[topic], wall_ns, data, received_ns)


def _json_schema(topic: str, properties: Mapping[str, Any]) -> dict[str, Any]:
    return {"title": topic, "type": "object", "properties": dict(properties)}
