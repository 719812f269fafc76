"""Plans of rooms: furniture stands inside and apart, doors stay free, and a seed is one room."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tools.rooms.furnished import development_styles, evaluation_styles
from tools.rooms.furnished.furniture import KINDS
from tools.rooms.furnished.plan import overlap, room_plan
from tools.rooms.furnished.style import styles_digest

STYLES = (*development_styles.STYLES, *evaluation_styles.STYLES)

EVALUATION_DIGEST = "80ea88ebd5b85a064de2cfc6ce977406bd2e75618270ee5936c921d346e9e787"
"""A change of it makes another benchmark: no figure of before compares with any of after."""

any_room = given(style=st.sampled_from(STYLES), seed=st.integers(0, 1 << 32))


def square(x: float, y: float, side: float) -> np.ndarray:
    return np.array([(x, y), (x + side, y), (x + side, y + side), (x, y + side)])


def test_outlines_that_touch_do_not_overlap_and_one_within_another_does():
    assert not overlap(square(0, 0, 1), square(1, 0, 1))
    assert overlap(square(0, 0, 1), square(0.99, 0.99, 1))
    assert overlap(square(0, 0, 3), square(1, 1, 1))
    turned = np.array([(1.5, -1.0), (2.5, 0.0), (1.5, 1.0), (0.5, 0.0)])  # its bounds overlap, it does not
    assert not overlap(square(2.0, 0.51, 0.2), turned)
    assert overlap(square(0.0, -0.5, 1.0), turned)


@any_room
def test_furniture_stands_inside_the_room_and_apart(style, seed):
    plan = room_plan(style, seed)
    assert len(plan.placed) >= 4
    for piece in plan.placed:
        assert plan.layout.contains(piece.footprint(0.02)).all()
        kind = KINDS[piece.kind]
        width, depth, height = piece.size
        assert kind.width_m[0] - 1e-3 <= width <= kind.width_m[1] + 1e-3
        assert height < plan.layout.height_m
        assert depth > 0.0
    for one, other in combinations(plan.placed, 2):
        assert not overlap(one.footprint(0.01), other.footprint(0.01)), (one.kind, other.kind)
    if plan.layout.notch is not None:
        low, high = plan.layout.notch
        gone = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
        assert not any(overlap(gone, piece.footprint()) for piece in plan.placed)


@any_room
def test_doors_can_be_opened_and_boards_of_windows_run_into_nothing(style, seed):
    plan = room_plan(style, seed)
    for wall in plan.layout.walls:
        for one in wall.openings:
            deep = 0.8 if one.kind == "door" else 0.14
            at = wall.start + wall.along * one.along_m
            aside, inwards = wall.along * one.width_m / 2, wall.inwards * deep
            before = np.array([at - aside, at + aside, at + aside + inwards, at - aside + inwards])
            for piece in plan.placed:
                in_the_way = piece.kind != "chair" if one.kind == "door" else piece.size[2] > one.sill_m - 0.03
                assert not (in_the_way and overlap(before, piece.footprint())), piece.kind


@any_room
def test_a_seed_is_one_room(style, seed):
    plan = room_plan(style, seed)
    assert plan.digest() == room_plan(style, seed).digest()
    assert plan.digest() != room_plan(style, seed + 1).digest()


@pytest.mark.parametrize("style", STYLES, ids=lambda style: style.name)
def test_rooms_of_a_style_differ_in_layout_and_keep_to_its_ranges(style):
    plans = [room_plan(style, seed) for seed in range(20)]
    assert len({tuple(plan.layout.half) for plan in plans}) == 20
    for plan in plans:
        assert style.height_m[0] - 1e-3 <= plan.layout.height_m <= style.height_m[1] + 1e-3
        assert style.eye_m[0] <= plan.eye_m <= style.eye_m[1]
        assert {piece.kind for piece in plan.placed} <= {*style.furniture, "chair"}
        assert len(plan.pictures) <= style.pictures[1]


def test_styles_for_evaluation_are_as_they_were_and_share_nothing_with_those_that_are_tuned_on():
    assert styles_digest(evaluation_styles.STYLES) == EVALUATION_DIGEST
    for kept in evaluation_styles.STYLES:
        for tuned in development_styles.STYLES:
            assert kept.name != tuned.name
            assert not {*kept.cloth, *kept.wood} & {*tuned.cloth, *tuned.wood}
            assert (kept.wall, kept.accent, kept.floor) != (tuned.wall, tuned.accent, tuned.floor)
