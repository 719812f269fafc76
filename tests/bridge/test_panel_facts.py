"""Facts are found by their place and by their name."""

from types import SimpleNamespace

import pytest

pytest.importorskip("bpy", reason="pip bpy is not installed")

from r2sego_blender.bridge.shared.panel_facts import Facts


def test_facts_are_found_by_place_and_name():
    chair, table = (SimpleNamespace(name=name) for name in ("chair", "table"))
    facts = Facts([chair, table])
    assert facts[0] is facts["chair"] is facts[-2] and tuple(facts[1:]) == (table,)
    assert "table" in facts and table in facts and "lamp" not in facts
    assert (facts.find("table"), facts.find("lamp")) == (1, -1)
    with pytest.raises(KeyError, match="lamp"):
        facts["lamp"]
    with pytest.raises(IndexError):
        facts[2]
