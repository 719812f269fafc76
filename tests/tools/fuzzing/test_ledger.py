"""What was searched adds up over many sittings, and begins anew with a fault."""

from __future__ import annotations

from tools.fuzzing.formats import HARNESSES
from tools.fuzzing.ledger import forget, least_searched, record, searched


def test_sittings_add_up_and_what_lacks_most_comes_first(tmp_path):
    file = tmp_path / "searched.json"
    assert least_searched(["poses/a", "poses/b"], 600, file) == {"poses/a": 600, "poses/b": 600}
    record("poses/a", 200, 5_000, file)
    record("poses/a", 250, 7_000, file)
    assert list(least_searched(["poses/a", "poses/b"], 600, file).items()) == [("poses/b", 600), ("poses/a", 150)]
    assert least_searched(["poses/a"], 450, file) == {}
    (found,) = searched(file).values()
    assert (found.seconds, found.inputs) == (450, 12_000) and found.date
    forget("poses/a", file)
    assert least_searched(["poses/a"], 600, file) == {"poses/a": 600}


def test_the_ledger_has_formats_alone():
    assert set(searched()) <= {one.name for one in HARNESSES}
