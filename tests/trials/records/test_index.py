"""Numbers are never used twice, whatever was cut off, and what was judged last counts."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.outcome import Failure, Judgement, Outcome, Unusable
from r2sego_blender.trials.records.index import CUT_OFF, RecordIndex

PLAN = "ab" * 32
SUCCESS = Judgement(Outcome.SUCCESS, (), 3.5, 2.0)
FAILED = Judgement(Outcome.FAILURE, ((Failure.NO_SUPPORT, "1.2 s"),), 1.2, 3.0)


@pytest.fixture
def index(tmp_path) -> RecordIndex:
    return RecordIndex(tmp_path)


def test_a_study_without_records_has_none(index):
    assert index.entries() == [] and not index.folder.exists()


def test_records_come_back_as_they_were_judged(index):
    for trial, judgement in enumerate((SUCCESS, FAILED)):
        number = index.begin(trial, PLAN, tethered=trial == 0, simulated=True)
        index.judge(number, judgement)
        index.close(number, "cd" * 32)
    first, second = index.entries()
    assert (first.number, first.trial, first.plan, first.simulated, first.sha256) == (1, 0, PLAN, True, "cd" * 32)
    assert (first.judgement, second.judgement, second.sensors) == (SUCCESS, FAILED, FAILED)
    assert [entry.ended for entry in (first, second)] == [(0, True, Outcome.SUCCESS), (1, False, Outcome.FAILURE)]
    assert [entry.name for entry in (first, second)] == ["0001.mcap", "0002.mcap"]


def test_a_record_that_was_cut_off_is_unusable(index):
    index.begin(0, PLAN, tethered=False, simulated=False)
    (entry,) = index.entries()
    assert entry.judgement == CUT_OFF and entry.sensors is None and entry.sha256 == ""
    assert entry.judgement.reasons[0][0] is Unusable.CUT_OFF


def test_a_persons_later_judgement_counts_and_the_sensors_stays(index):
    number = index.begin(0, PLAN, tethered=False, simulated=False)
    index.judge(number, SUCCESS)
    index.close(number, "cd" * 32)
    by_hand = Judgement(Outcome.FAILURE, ((Failure.INTERVENTION, "seen on video"),), 3.5, 2.0, manual="A. Person")
    index.judge(number, by_hand)
    (entry,) = index.entries()
    assert entry.judgement == by_hand and entry.sensors == SUCCESS and entry.sha256 == "cd" * 32


@given(st.data())
def test_no_number_is_used_twice(tmp_path_factory, data):
    """Whatever is cut off, lost or put beside: a number in a line or of a file is taken."""
    index = RecordIndex(tmp_path_factory.mktemp("study"))
    used: list[int] = []
    for _ in range(data.draw(st.integers(1, 6))):
        number = index.begin(0, PLAN, tethered=False, simulated=False)
        assert number not in used
        used.append(number)
        deed = data.draw(st.sampled_from(["judge", "cut", "file", "restored", "junk"]))
        if deed == "judge":
            index.judge(number, SUCCESS)
        elif deed == "cut":  # a kill, within a line of a record that has its file
            (index.folder / f"{number:04d}.mcap").touch()
            lines = index.file.read_bytes()
            index.file.write_bytes(lines[: len(lines) - data.draw(st.integers(0, 60))])
        elif deed == "file":
            used.append(number + 3)
            (index.folder / f"{number + 3:04d}.mcap").touch()
        elif deed == "restored":  # an index of an older backup, beside all files
            for one in used:
                (index.folder / f"{one:04d}.mcap").touch()
            index.file.write_bytes(b"")
        else:
            with index.file.open("ab") as file:
                file.write(b"\xff\x00 {]")


@given(st.binary(max_size=200))
def test_lines_that_are_none_hide_no_others(tmp_path_factory, junk):
    index = RecordIndex(tmp_path_factory.mktemp("study"))
    index.judge(index.begin(0, PLAN, tethered=False, simulated=False), SUCCESS)
    with index.file.open("ab") as file:
        file.write(junk)
    index.judge(index.begin(1, PLAN, tethered=False, simulated=False), FAILED)
    assert [entry.judgement for entry in index.entries()] == [SUCCESS, FAILED]


def test_lines_of_other_forms_are_passed_over(index):
    number = index.begin(0, PLAN, tethered=False, simulated=False)
    right = json.loads(index.file.read_text())
    changes = ({"record": "1"}, {"record": 1.5}, {"trial": -1}, {"trial": True}, {"began": 3}, {"plan": "x" * 500})
    lines = [json.dumps(right | {"record": number + 1 + place} | change) for place, change in enumerate(changes)]
    index.file.write_text(index.file.read_text() + "\n".join(lines) + "\n")
    assert [entry.number for entry in index.entries()] == [number]


def test_an_index_that_is_no_file_is_refused(index):
    index.folder.mkdir()
    Path(index.file).mkdir()
    with pytest.raises(TrialError):
        index.entries()
