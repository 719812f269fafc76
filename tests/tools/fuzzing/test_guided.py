"""The search by coverage runs, and keeps what it found."""

from __future__ import annotations

import pytest

from tools.fuzzing.guided import guide


@pytest.fixture(autouse=True)
def _atheris():
    pytest.importorskip("atheris", reason="atheris is not installed: the extra `fuzz`, of Python 3.11 alone")


def test_a_format_is_searched_and_its_corpus_kept(tmp_path):
    runs, _ = guide("poses/picks.json", 5, tmp_path)
    assert runs > 20
    assert len(list((tmp_path / "poses_picks.json/corpus").iterdir())) > 20
    before = (tmp_path / "poses_picks.json/log").read_bytes()
    assert guide("poses/picks.json", 5, tmp_path, again=True)[0] == runs  # its seconds are spent
    assert (tmp_path / "poses_picks.json/log").read_bytes() == before
    assert guide("poses/picks.json", 10, tmp_path, again=True)[0] > runs


def test_what_a_reader_does_not_end_with_is_found(tmp_path):
    _, failing = guide("spinning", 3, tmp_path, hang_s=1, formats="tests.tools.fuzzing.spinning")
    kept = list((tmp_path / "spinning/failing").glob("hang-*.txt"))
    assert failing == len(kept) > 0
    assert all(file.read_bytes() != b"right" for file in kept)
