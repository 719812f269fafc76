"""What commands tell: the same for a person in lines and for a program as one object or in events."""

import io
import json

import pytest

from r2sego_blender.commands import options
from r2sego_blender.commands.options import Output
from r2sego_blender.core.progress import JsonProgress


@pytest.fixture
def events(monkeypatch) -> io.StringIO:
    stream = io.StringIO()
    monkeypatch.setattr(options, "JsonProgress", lambda: JsonProgress(stream))
    return stream


def test_counts_are_words_for_a_person_and_an_object_for_a_program(capsys, events):
    person, program = Output(as_object=False, as_events=False), Output(as_object=False, as_events=True)
    person.tell(attempts=3, failures={"it fell": 2, "it is off its way": 1})
    person.tell(failures={})
    assert capsys.readouterr().out.splitlines() == [
        "attempts: 3",
        "failures: it fell (2), it is off its way (1)",
        "failures: none",
    ]
    program.tell(failures={"it fell": 2})
    assert json.loads(events.getvalue()) == {"event": "result", "failures": {"it fell": 2}}


def test_a_result_is_lines_or_one_object_or_an_event(capsys, events):
    told, shown = {"accepted": 2}, []
    for as_object, as_events in ((False, False), (True, False), (True, True)):
        Output(as_object, as_events).show(told, lambda result: [f"{result['accepted']} are trained on"])
        shown.append(capsys.readouterr().out)
    assert shown[0] == "2 are trained on\n" and json.loads(shown[1]) == told and shown[2] == ""
    assert json.loads(events.getvalue()) == {"event": "result", **told}
