"""Points shown on the floor: the ground through them, and how they are written."""

from __future__ import annotations

import numpy as np
import pytest
from expected_errors import refused
from hypothesis import given, settings
from hypothesis import strategies as st
from progress_recorder import ProgressRecorder
from wrong_world import FLOOR, LENS, true_cameras, wrong_similarity

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.frame.floor_points import FloorPoint, ground_of, ground_through
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.errors import CaptureError


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), tilt_deg=st.floats(0.0, 40.0), count=st.integers(3, 4))
def test_any_tilt_is_undone(seed, tilt_deg, count):
    turn, cameras = true_cameras()
    similarity = wrong_similarity(seed, tilt_deg=tilt_deg)
    captures = [Capture(f"p{i}", None, c.transformed(similarity)) for i, c in enumerate(cameras)]
    spots = FLOOR[:count] @ turn[:3, :3].T
    points = []
    for spot in spots:
        views = [(i, cameras[i].project(spot)[0]) for i in (0, 3)]
        points.append(_Shown(captures, views))
    ground = ground_through(captures, None, points)
    up = similarity[:3, :3] @ [0, 0, 1]
    assert np.degrees(np.arccos(np.clip(ground.normal @ up, -1, 1))) < 1e-4
    assert np.abs(ground.height([similarity[:3, :3] @ s + similarity[:3, 3] for s in spots])).max() < 1e-7


class _Shown:
    """A floor point whose photographs are not on disk."""

    def __init__(self, captures, views) -> None:
        self.captures, self.views = captures, views

    def place(self, captures, sparse):
        from r2sego_blender.captures.frame.lifting import intersection

        point = intersection([self.captures[i].camera for i, _ in self.views], [p for _, p in self.views])
        return point, 1e-4 * np.eye(3)


def test_an_unsure_point_counts_for_little_and_an_unsure_tilt_is_said():
    """Two photographs a hand apart hardly place a point: it must not tilt the floor."""
    turn, cameras = true_cameras()
    captures = [Capture(f"p{i}", None, camera) for i, camera in enumerate(cameras)]
    spots = np.vstack([FLOOR, [[0.9, 2.6, 0.12]]]) @ turn[:3, :3].T
    placed = [_Placed(spot, sigma) for spot, sigma in zip(spots, [0.004] * 4 + [0.2], strict=True)]
    told = ProgressRecorder()
    ground = ground_through(captures, None, placed, told)
    assert np.degrees(np.arccos(ground.normal[2])) < 0.05 and abs(ground.offset) < 1e-3
    assert not told.warnings
    unsure = ground_through(captures, None, [_Placed(spot, 0.1) for spot in spots[:4]], told)
    assert "tilt sure to" in unsure.description and any("one point alone" in text for text in told.warnings)


class _Placed:
    def __init__(self, point, sigma) -> None:
        self.point, self.sigma = point, sigma

    def place(self, captures, sparse):
        return self.point, self.sigma**2 * np.eye(3)


@pytest.mark.parametrize("text", ["p0", "p0:1", "p0:1,2,3", "p0:a,b", "p0:1,2=", "="])
def test_floor_points_are_parsed_strictly(text):
    with refused(CaptureError, "floor points"):
        FloorPoint.parse(text)
    assert FloorPoint.parse("a:b:1,2=c:3,4").views == (("a:b", (1.0, 2.0)), ("c", (3.0, 4.0)))


def test_the_ground_by_hand_says_what_was_given():
    captures = [Capture("p", None, LENS.at(look_at([0, 0, 1.5], [1, 0, 1])))]
    assert "up was (0.0000, 0.0000, 1.0000), -0.100 m" in ground_of(captures, None, -0.1).description
