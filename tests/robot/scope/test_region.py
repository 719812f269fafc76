"""The polygon of a region: read from text, written again, and refused where it bounds nothing."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.scope.region import area_m2, format_polygon, parse_polygon, problem_of

SQUARE = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.5), (0.0, 1.5))


@given(st.integers(3, 40), st.floats(0.5, 10.0), st.floats(-3.0, 3.0))
def test_a_polygon_survives_as_text(count, radius_m, x):
    turns = [2.0 * math.pi * k / count for k in range(count)]
    corners = [(x + radius_m * math.cos(a), radius_m * math.sin(a)) for a in turns]
    again = parse_polygon(format_polygon(corners))
    assert [tuple(map(pytest.approx, corner)) for corner in again] == [
        tuple(round(v, 4) for v in corner) for corner in corners
    ]
    inscribed_m2 = 0.5 * count * radius_m**2 * math.sin(2.0 * math.pi / count)
    assert area_m2(again) == pytest.approx(inscribed_m2, rel=1e-3)


def test_either_way_around_is_the_same_region():
    assert area_m2(SQUARE) == pytest.approx(3.0)
    assert area_m2(SQUARE[::-1]) == pytest.approx(-3.0)
    assert problem_of(SQUARE[::-1]) == ""


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "has 0 corners"),
        ("0,0 1,1", "has 2 corners"),
        ("0,0 1 2,2", "no polygon"),
        ("0,0 1,nan 2,2", "not finite"),
        ("0,0 2,2 2,0 0,2", "crosses itself: sides 1 and 3"),
        ("0,0 2,0 0,2 2,2", "crosses itself: sides 2 and 4"),
        ("0,0 1,0 2,0", "square metres"),
        ("0,0 100,0 100,100 0,100", "1e\\+04 square metres"),
    ],
)
def test_what_bounds_no_region_is_refused(text, says):
    with pytest.raises(RobotError, match=says):
        parse_polygon(text)


def test_too_many_corners_are_refused():
    assert "501 corners" in problem_of([(math.cos(a), math.sin(a)) for a in range(501)])
