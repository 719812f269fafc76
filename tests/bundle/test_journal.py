"""The journal: what is killed or damaged on the way is told as not made, and nothing else is lost."""

import json

import pytest

from r2sego_blender.bundle.journal import JOURNAL, Journal


@pytest.fixture
def journal(tmp_path) -> Journal:
    return Journal(tmp_path)


def test_a_journal_that_is_not_there_is_empty(journal):
    assert journal.steps() == [] and journal.inputs() == {} and journal.outputs() == {}


def test_the_last_record_of_a_step_counts(journal):
    journal.write(step="a.txt", inputs="1", output="x")
    journal.write(step="b.txt", inputs="2", output="y")
    journal.write(step="a.txt", inputs="3", output="z")
    assert [record["inputs"] for record in journal.steps()] == ["1", "2", "3"]
    assert journal.inputs() == {"a.txt": "3", "b.txt": "2"}
    assert journal.outputs() == {"a.txt": "z", "b.txt": "y"}


def test_of_a_step_killed_while_it_published_nothing_is_said(journal):
    journal.write(step="a.txt", inputs="1", output="x")
    journal.write(step="b.txt", inputs="2", output="y")
    journal.write(publishing="a.txt")
    assert journal.inputs() == {"b.txt": "2"} and journal.outputs() == {"b.txt": "y"}
    assert len(journal.steps()) == 2
    journal.write(step="a.txt", inputs="3", output="z")
    assert journal.inputs()["a.txt"] == "3" and journal.outputs()["a.txt"] == "z"


def test_a_cut_off_line_is_passed_over(journal, tmp_path):
    journal.write(step="a.txt")
    with (tmp_path / JOURNAL).open("a") as file:
        file.write('{"step": "b.t')
    assert [record["step"] for record in journal.steps()] == ["a.txt"]
    journal.write(step="c.txt")
    assert [record["step"] for record in journal.steps()] == ["a.txt", "c.txt"]


@pytest.mark.parametrize(
    "line",
    [
        b"\x93\xfe\x00garbage",
        b"7",
        b'["step"]',
        b'"step"',
        b"null",
        b'{"step": ["b"]}',
        b'{"step": "b", "inputs": "", "output": 3}',
        b'{"step": "b", "frame": [[1, 0], [0, 1]]}',
        b'{"step": "b", "frame": 7}',
        b'{"step": "b", "seconds": "7"}',
    ],
)
def test_a_damaged_line_is_passed_over(journal, tmp_path, line):
    journal.write(step="a.txt", inputs="1", output="x")
    with (tmp_path / JOURNAL).open("ab") as file:
        file.write(line + b"\n")
    assert [record["step"] for record in journal.steps()] == ["a.txt"]
    assert journal.inputs().keys() == journal.outputs().keys() == {"a.txt"}


def test_each_record_is_a_line_of_json(journal, tmp_path):
    journal.write(step="a.txt", seconds=0.5)
    journal.write(step="b.txt", frame=None)
    lines = (tmp_path / JOURNAL).read_text().splitlines()
    assert [json.loads(line) for line in lines] == [{"step": "a.txt", "seconds": 0.5}, {"step": "b.txt", "frame": None}]
