"""The choice of neighbours: overlap, baseline angle, visibility."""

from __future__ import annotations

import tracemalloc

import numpy as np

from r2sego_blender.captures.matching.neighbours import neighbours
from r2sego_blender.core.cameras import Camera, look_at


def at(x: float, target_y: float = 3.0) -> Camera:
    pose = look_at(np.array([x, 0.0, 1.0]), np.array([0.0, target_y, 1.0]))
    return Camera(64, 48, 60.0, 60.0, 32.0, 24.0, pose)


POINTS = np.random.default_rng(0).uniform([-0.5, 2.8, 0.7], [0.5, 3.2, 1.3], (200, 3))


def test_a_useful_baseline_is_preferred_to_none_and_to_a_wide_one() -> None:
    chosen = neighbours([at(0.0), at(0.01), at(0.5), at(4.0)], POINTS, 3)
    assert chosen[0][0] == 2
    assert all(i not in sources for i, sources in enumerate(chosen))


def test_a_camera_that_looks_away_is_nobodys_neighbour() -> None:
    chosen = neighbours([at(0.0), at(0.4), at(0.2, target_y=-3.0)], POINTS, 4)
    assert chosen == ((1,), (0,), ())


def test_the_visibility_record_outweighs_the_projection() -> None:
    seen = np.ones((200, 3), bool)
    seen[:, 1] = False
    assert neighbours([at(0.0), at(0.4), at(0.8)], POINTS, 2, seen)[0] == (2,)


def test_no_more_than_count() -> None:
    cameras = [at(0.2 * i) for i in range(6)]
    assert all(len(sources) == 2 for sources in neighbours(cameras, POINTS, 2))


def test_many_cameras_that_each_see_little_take_little_memory() -> None:
    """A ray from every point to every camera would be 144 MB."""
    rng = np.random.default_rng(1)
    points = rng.uniform([-0.5, 2.8, 0.7], [0.5, 3.2, 1.3], (60_000, 3))
    seen = np.zeros((60_000, 100), bool)
    first = rng.integers(0, 98, 60_000)
    for step in (0, 1, 2):
        seen[np.arange(60_000), first + step] = True
    tracemalloc.start()
    chosen = neighbours([at(0.2 * i) for i in range(100)], points, 4, seen)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 20e6
    assert [set(sources) for sources in chosen[2:98]] == [{i - 2, i - 1, i + 1, i + 2} for i in range(2, 98)]
