"""Outlines are closed, run around the room, and their openings lie within walls and apart."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tools.rooms.furnished import development_styles
from tools.rooms.furnished.layout import draw_layout

SEEDS = range(40)
RECTANGLE, L_SHAPE = (replace(development_styles.WARM, l_shaped=share) for share in (0.0, 1.0))


def area_m2(corners: np.ndarray) -> float:
    """Positive for corners that run counter-clockwise."""
    x, y = corners.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


@pytest.mark.parametrize("seed", SEEDS)
def test_walls_run_around_the_floor_and_look_inwards(seed):
    for style, corners in ((RECTANGLE, 4), (L_SHAPE, 6)):
        layout = draw_layout(style, np.random.default_rng(seed))
        outline = layout.corners()
        expected = np.prod(2 * layout.half) - (0.0 if layout.notch is None else np.prod(np.ptp(layout.notch, axis=0)))
        assert len(outline) == corners
        assert area_m2(outline) == pytest.approx(expected)
        for wall in layout.walls:
            middle = (wall.start + wall.end) / 2
            assert min(np.abs(wall.end - wall.start)) == 0.0  # along x or y
            assert layout.contains(middle + 0.05 * wall.inwards)
            assert not layout.contains(middle - 0.05 * wall.inwards)
        convex = [wall.convex[0] for wall in layout.walls]
        assert convex.count(False) == (corners == 6)
        assert [wall.convex[1] for wall in layout.walls] == [*convex[1:], convex[0]]


@pytest.mark.parametrize("seed", SEEDS)
def test_doors_and_windows_lie_within_their_wall_and_apart(seed):
    layout = draw_layout(L_SHAPE, np.random.default_rng(seed))
    openings = [(wall, one) for wall in layout.walls for one in wall.openings]
    assert [one.kind for _, one in openings].count("door") == 1
    for wall, one in openings:
        assert one.along_m - one.width_m / 2 > 0.3 and one.along_m + one.width_m / 2 < wall.length_m - 0.3
        assert 0.0 <= one.sill_m < one.head_m < layout.height_m
    for wall in layout.walls:
        for one, following in pairwise(wall.openings):
            assert following.along_m - one.along_m > (one.width_m + following.width_m) / 2 + 0.3
