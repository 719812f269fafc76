"""What images say of points, against one point at a time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.stereo.evidence import KnownDepth, collect_votes
from r2sego_blender.geometry.visibility.point_visibility import looked_up, same_depth

CAMERA = Camera(24, 18, 15.0, 16.0, 11.5, 9.5, look_at((0.3, -2.0, 1.2), (0.0, 0.5, 1.0)))


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_points_read_the_pixel_they_fall_on(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-2.5, 2.5, (40, 3))
    grey, colour = rng.random(CAMERA.shape), rng.random((*CAMERA.shape, 3))
    inside, depth, *found = looked_up(points, CAMERA, grey, colour)
    local = points @ CAMERA.camera_from_world[:3, :3].T + CAMERA.camera_from_world[:3, 3]
    at = 0
    for point, (x, y, z) in enumerate(local):
        u, v = (15.0 * x / z + 11.5, 16.0 * y / z + 9.5) if z > 0 else (-1.0, -1.0)
        assert inside[point] == (0.0 <= u < 24 and 0.0 <= v < 18)
        if inside[point]:
            assert depth[at] == pytest.approx(z)
            assert found[0][at] == grey[int(v), int(u)]
            np.testing.assert_array_equal(found[1][at], colour[int(v), int(u)])
            at += 1
    assert at == len(depth) == len(found[0]) == len(found[1])


def test_images_of_points_have_their_shape():
    points = CAMERA.unproject(np.full(CAMERA.shape, 2.0))
    inside, depth, shown = looked_up(points, CAMERA, np.arange(24 * 18).reshape(CAMERA.shape))
    assert inside.shape == CAMERA.shape and inside.all()
    np.testing.assert_allclose(depth, 2.0)
    np.testing.assert_array_equal(shown, np.arange(24 * 18))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_kernel_of_votes_and_numpy_say_the_same_of_a_depth_map(seed):
    """Both project alike: a point agrees, lies in front or behind as its pixel's depth says."""
    rng = np.random.default_rng(seed)
    depth = rng.choice([0.0, 1.0, 2.0, 2.2, 3.0], CAMERA.shape).astype(np.float32)
    points = CAMERA.unproject(rng.uniform(0.5, 3.5, CAMERA.shape)).reshape(-1, 3)
    inside, z, known = looked_up(points, CAMERA, depth)
    votes = collect_votes(points, [KnownDepth(CAMERA, depth)], 0.1)
    np.testing.assert_array_equal(votes.through[inside], known > z * 1.1)
    np.testing.assert_array_equal(votes.agree[inside], same_depth(known, z, 0.1) & (known > 0))
    np.testing.assert_array_equal(votes.front[inside], (known > 0) & (known < z * 0.9))
    assert not (votes.agree + votes.through + votes.front)[~inside].any()
