"""Errors keep what they say on their way through another process."""

from __future__ import annotations

import pickle

import pytest

from r2sego_blender.core import errors

KINDS = [kind for kind in vars(errors).values() if isinstance(kind, type)]
FAMILY = [kind for kind in KINDS if issubclass(kind, errors.R2SEgoError)]


@pytest.mark.parametrize("kind", FAMILY)
def test_a_pickled_error_says_the_same(kind):
    raised = kind("the file is damaged", where="room/scene.toml", cure="Import it again.")
    again = pickle.loads(pickle.dumps(raised))
    assert type(again) is kind
    assert str(again) == str(raised) == "room/scene.toml: the file is damaged. Import it again."
    assert (again.what, again.where, again.cure) == (raised.what, raised.where, raised.cure)


def test_a_failed_rename_is_told_by_the_place_it_was_for(tmp_path):
    (tmp_path / ".unfinished-metrics.json").write_text("{}")
    (tmp_path / "metrics.json").mkdir()
    with pytest.raises(OSError) as raised:
        (tmp_path / ".unfinished-metrics.json").replace(tmp_path / "metrics.json")
    assert errors.of_file(raised.value).where == str(tmp_path / "metrics.json")
