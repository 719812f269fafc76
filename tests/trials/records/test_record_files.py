"""A record holds what was put into it, and of one that was cut off anywhere all up to its last whole chunk."""

import io
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader

from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.events import EventKind, TrialEvent
from r2sego_blender.trials.line.decoding import Sample
from r2sego_blender.trials.outcome import Failure, Judgement, Outcome
from r2sego_blender.trials.records.reading import read_record
from r2sego_blender.trials.records.writing import CHUNK_BYTES, EVENTS, LOST, RecordWriter

WALL_NS = 1_790_000_000_000_000_000
ABOUT = {"record": 7, "plan": "ab" * 32, "trial": {"index": 3}}
FAILED = Judgement(Outcome.FAILURE, ((Failure.TETHER, "41.5 N at 2.10 s"),), 1.5, 41.5)
PIECES = st.lists(st.binary(max_size=9000), max_size=30)


def written(file, pieces, lost=(), judgement=None):
    writer = RecordWriter(file, ABOUT)
    for index, piece in enumerate(pieces):
        writer.received(piece, index * 1000, WALL_NS + index * 1000)
    for time_ns in lost:
        writer.tell(LOST, {"text": "unplugged"}, time_ns, WALL_NS + time_ns)
    if judgement is not None:
        writer.judgement(judgement, 10**9, WALL_NS)
    return writer


@settings(max_examples=40)
@given(PIECES)
def test_bytes_come_back_in_their_order_with_both_clocks(tmp_path_factory, pieces):
    file = tmp_path_factory.mktemp("records") / "0001.mcap"
    written(file, pieces, lost=(5, 6), judgement=FAILED).close()
    record = read_record(file)
    assert b"".join(piece.data for piece in record.received) == b"".join(pieces)
    assert all(piece.wall_ns - piece.received_ns == WALL_NS for piece in record.received)
    assert [piece.received_ns for piece in record.received] == sorted(piece.received_ns for piece in record.received)
    assert record.about == ABOUT and record.lost_ns == (5, 6) and record.judgements == (FAILED,) and record.finished


def test_events_come_back(tmp_path):
    writer = written(tmp_path / "a.mcap", [])
    events = [TrialEvent(kind, 10 + index, f"ä {index}", WALL_NS + index) for index, kind in enumerate(EventKind)]
    for event in events:
        writer.tell(EVENTS, {"kind": event.kind.value, "text": event.text}, event.time_ns, event.wall_ns)
    assert read_record(tmp_path / "a.mcap").events == tuple(events)  # each is written at once
    writer.close()
    assert read_record(tmp_path / "a.mcap").events == tuple(events)


@settings(max_examples=30)
@given(PIECES, st.floats(0, 1))
def test_of_a_file_cut_off_anywhere_every_whole_chunk_is_read(tmp_path_factory, pieces, share):
    file = tmp_path_factory.mktemp("records") / "0001.mcap"
    writer = written(file, pieces)
    writer.flush()
    begins, data = chunk_ends(file.read_bytes()), file.read_bytes()
    smallest = min(begins, default=len(data))
    size = smallest + round(share * (len(data) - smallest))
    file.write_bytes(data[:size])
    whole = sum(bytes_of for end, bytes_of in begins.items() if end <= size)
    record = read_record(file)
    assert sum(len(piece.data) for piece in record.received) == whole
    assert (
        b"".join(pieces).startswith(b"".join(piece.data for piece in record.received))
        and not record.complete
        and not record.finished
    )


def chunk_ends(data):
    """Where each chunk of a record ends -> the bytes received that it holds."""
    stream, found = io.BytesIO(data), {}
    reader = StreamReader(stream, emit_chunks=True)
    try:
        for record in reader.records:
            if isinstance(record, Chunk):
                found[stream.tell()] = received_in(record)
    except Exception:  # its end
        pass
    return found


def received_in(chunk):
    from mcap.records import Channel, Message
    from mcap.stream_reader import breakup_chunk

    records = breakup_chunk(chunk)
    topic = {1: "received"} | {record.id: record.topic for record in records if isinstance(record, Channel)}
    return sum(len(one.data) for one in records if isinstance(one, Message) and topic[one.channel_id] == "received")


def test_no_chunk_has_more_than_sixteen_kibibytes(tmp_path):
    writer = written(tmp_path / "a.mcap", [b"x" * size for size in (1, 500, 4096, 10_000, 100_000)] * 5)
    for _ in range(100):
        writer.samples([Sample(65535, 2**32 - 1, (-(2**31),) * 8, 255, 0)] * 100, 10**9, WALL_NS)
    writer.close()
    with (tmp_path / "a.mcap").open("rb") as stream:
        chunks = [one for one in StreamReader(stream, emit_chunks=True).records if isinstance(one, Chunk)]
    assert len(chunks) > 50 and max(chunk.uncompressed_size for chunk in chunks) <= CHUNK_BYTES


def test_other_programs_read_a_finished_record(tmp_path):
    """By its index, with schemas for what is JSON."""
    writer = written(tmp_path / "a.mcap", [b"abc"], judgement=FAILED)
    writer.samples([Sample(1, 1000, (5, 6), 0, 10), Sample(2, 2000, (7, 8), 0, 10)], 10, WALL_NS)
    writer.close()
    with (tmp_path / "a.mcap").open("rb") as stream:
        found = {channel.topic: message for _, channel, message in make_reader(stream).iter_messages()}
    assert found["received"].data == b"abc" and found["received"].log_time == WALL_NS
    assert b'"raw":[[5,6],[7,8]]' in found["samples"].data


@given(st.integers(0, 2**32), st.binary(min_size=1, max_size=30))
def test_damage_is_refused_or_not_called_complete(tmp_path_factory, place, bytes_):
    file = tmp_path_factory.mktemp("records") / "0001.mcap"
    written(file, [b"$1,2,3,0*ABCD\r\n" * 200] * 3, judgement=FAILED).close()
    right = file.read_bytes()
    data = bytearray(right)
    begin = place % len(data)
    data[begin : begin + len(bytes_)] = bytes_
    file.write_bytes(data)
    whole = b"$1,2,3,0*ABCD\r\n" * 600
    in_data_section = begin < right.rindex(b"\x0f" + (4).to_bytes(8, "little"))
    try:
        record = read_record(file)
    except TrialError:
        return
    found = b"".join(piece.data for piece in record.received)
    assert whole.startswith(found)
    assert data == right or not (record.finished and in_data_section)
    assert found == whole or not record.complete


def test_nothing_measured_is_null_and_comes_back(tmp_path):
    unknown = Judgement(Outcome.UNUSABLE, (), math.nan, math.nan)
    written(tmp_path / "a.mcap", [], judgement=unknown).close()
    (found,) = read_record(tmp_path / "a.mcap").judgements
    assert found.outcome is Outcome.UNUSABLE and math.isnan(found.support_s) and math.isnan(found.highest_tether_n)


@pytest.mark.parametrize("data", [b"", b"x" * 100, b"\x89MCAP0\r\n"])
def test_another_file_is_refused(tmp_path, data):
    (tmp_path / "a.mcap").write_bytes(data)
    with pytest.raises(TrialError):
        read_record(tmp_path / "a.mcap")
    with pytest.raises(TrialError):
        read_record(tmp_path / "none.mcap")
