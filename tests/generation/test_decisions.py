"""A person's word on a view overrules the gate's."""

import pytest

from r2sego_blender.core.errors import GenerationError
from r2sego_blender.generation.decisions import DECISION, is_accepted, save_decision


@pytest.mark.parametrize("by_gate", [True, False])
def test_the_hand_overrules_the_gate(tmp_path, by_gate):
    assert is_accepted(tmp_path, by_gate) is by_gate
    save_decision(tmp_path, True)
    assert is_accepted(tmp_path, by_gate)
    save_decision(tmp_path, False)
    assert not is_accepted(tmp_path, by_gate)
    assert [path.name for path in tmp_path.iterdir()] == [DECISION]
    for _ in range(2):
        save_decision(tmp_path, None)
        assert is_accepted(tmp_path, by_gate) is by_gate


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"accepted": "no"}', '{"accepted": 1}', "null"])
def test_a_damaged_decision_is_not_guessed(tmp_path, text):
    (tmp_path / DECISION).write_text(text)
    with pytest.raises(GenerationError, match="decision is damaged"):
        is_accepted(tmp_path, True)
