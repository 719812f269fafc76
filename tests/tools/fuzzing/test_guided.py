"""The search by coverage runs, and keeps what it found."""

from __future__ import annotations

import pytest

from tools.fuzzing.guided import guide


def test_a_format_is_searched_and_its_corpus_kept(tmp_path):
    pytest.importorskip("atheris", reason="atheris is not installed: the extra `fuzz`, of Python 3.11 alone")
    runs, _ = guide("poses/picks.json", 5, tmp_path)
    assert runs > 20
    assert len(list((tmp_path / "poses_picks.json/corpus").iterdir())) > 20
    before = (tmp_path / "poses_picks.json/log").read_bytes()
    assert guide("poses/picks.json", 5, tmp_path, again=True)[0] == runs  # its seconds are spent
    assert (tmp_path / "poses_picks.json/log").read_bytes() == before
    assert guide("poses/picks.json", 10, tmp_path, again=True)[0] > runs
