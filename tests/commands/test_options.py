"""What commands tell: the same for a person in lines and for a program in events."""

import io
import json

from r2sego_blender.commands.options import tell
from r2sego_blender.core.progress import SILENT, JsonProgress


def test_counts_are_words_for_a_person_and_an_object_for_a_program(capsys):
    tell(SILENT, attempts=3, failures={"it fell": 2, "it is off its way": 1})
    tell(SILENT, failures={})
    assert capsys.readouterr().out.splitlines() == [
        "attempts: 3", "failures: it fell (2), it is off its way (1)", "failures: none"
    ]  # fmt: skip
    events = io.StringIO()
    tell(JsonProgress(events), failures={"it fell": 2})
    assert json.loads(events.getvalue())["failures"] == {"it fell": 2}
