"""What became of generated views, read and decided by hand."""

import json

import pytest

from r2sego_blender.core.errors import GenerationError
from r2sego_blender.generation.view_records import decide, read_views


def write_view(folder, rank, accepted=True, estimate=True, **more):
    view = folder / f"{rank:03d}"
    view.mkdir(parents=True)
    record = {
        "accepted": accepted,
        "reason": "registered: 9 of 10 patches agree" if accepted else "rejected: few",
        "generator": "blending",
        "rank": rank,
        "candidate": 10 * rank,
        "rollout": 1,
        "frame": rank,
        "reference": 0,
        "reference_name": "a.png",
        "overlap": 0.5,
        "query": {},
        "estimate": {} if estimate else None,
        "inliers": 9,
        "spread": 0.5,
        **more,
    }
    (view / "pose.json").write_text(json.dumps(record))


@pytest.fixture
def views(tmp_path):
    """Three targets, of which 0 and 2 were rejected; 3 stood in and was rejected too, 4 stood in."""
    for rank, accepted in enumerate([False, True, False, False, True]):
        write_view(tmp_path, rank, accepted, estimate=rank != 2, offset_m=0.01 * rank)
    return tmp_path


def test_rejected_views_are_replaced_in_order(views):
    records = read_views(views, budget=3)
    assert [record.accepted for record in records] == [False, True, False, False, True]
    assert [record.replaced_by for record in records] == [3, -1, 4, -1, -1]
    assert [record.replaces for record in records] == [-1, -1, -1, 0, 2]
    assert records[3].figures == {"inliers": 9, "spread": 0.5, "offset_m": 0.03}


def test_what_a_person_decides_is_told_beside_the_gates_word(views):
    decide(views, {0: True, 1: False})
    first, second, *_ = read_views(views, budget=3)
    assert first.accepted and not second.accepted
    assert first.fate == "accepted by hand (by its figures: rejected: few)"
    assert first.replaced_by == 3  # that is past
    decide(views, {0: None})
    assert not read_views(views, budget=3)[0].accepted


def test_nothing_is_decided_when_one_view_cannot_be(views):
    with pytest.raises(GenerationError, match="no estimated pose"):
        decide(views, {1: False, 2: True})
    with pytest.raises(GenerationError, match="no generated view 9"):
        decide(views, {1: False, 9: False})
    assert all(record.by_hand is None for record in read_views(views, budget=3))
    decide(views, {2: False})  # to reject it needs no pose


def test_the_paths_note_is_told(views):
    (views / "001" / "path.json").write_text('{"note": "around a wall"}')
    assert [record.note for record in read_views(views, 3)] == ["", "around a wall", "", "", ""]


@pytest.mark.parametrize("damage", ["", "[]", "{", '{"rank": 0}', '{"rank": "0", "accepted": 1}'])
def test_damage_is_an_error_that_names_the_file(views, damage):
    (views / "001" / "pose.json").write_text(damage)
    with pytest.raises(GenerationError, match=r"001.pose\.json"):
        read_views(views, 3)


def test_a_round_without_views_has_none(tmp_path):
    assert read_views(tmp_path / "views", 3) == []


def test_what_is_told_of_a_view_that_is_no_text_does_not_hold_all_of_it(views):
    (views / "001" / "pose.json").write_bytes(b"\xff" + b"a" * 5000)
    with pytest.raises(GenerationError, match=r"pose\.json: this generated view cannot be read") as told:
        read_views(views, budget=3)
    assert len(str(told.value)) < 1000
