"""Trust in a capture's pixels: edges, creases, contradictions."""

import numpy as np
import pytest
from box_room import TABLE, arc, render

from r2sego_blender.config.settings import GenerationSettings
from r2sego_blender.generation.generators.visibility import capture_trust, depth_edges

SETTINGS = GenerationSettings()


def test_planes_and_creases_are_no_edges():
    camera = arc(1)[0]
    _, room = render(camera, boxes=())  # walls, floor and ceiling meet in creases only
    near, far = depth_edges(room, 0.03)
    assert not near.any()
    assert not far.any()


def test_both_sides_of_a_step_are_found():
    depth = np.full((20, 30), 3.0, np.float32)
    depth[:, 12:] = 2.0
    near, far = depth_edges(depth, 0.03)
    assert np.flatnonzero(near.any(axis=0)).tolist() == [12]
    assert np.flatnonzero(far.any(axis=0)).tolist() == [11]


@pytest.mark.parametrize("erosion", [0, 1, 2, 4])
def test_background_near_foreground_is_not_trusted(erosion):
    depth = np.full((20, 30), 3.0, np.float32)
    depth[:, 12:] = 2.0
    trust = capture_trust(depth, None, GenerationSettings(edge_erosion_px=erosion))
    refused = np.flatnonzero((trust == 0.0).all(axis=0))
    assert refused.tolist() == list(range(12 - erosion, 12))
    assert (trust[:, 12] < 0.2).all()  # the foreground's own edge: a last resort
    assert (trust[:, 14:] == 1.0).all()
    assert (trust[:, : 12 - max(erosion, 2)] == 1.0).all()


def test_unknown_and_contradicted_depth():
    camera = arc(1)[0]
    _, depth = render(camera, boxes=(TABLE,))
    depth[:10] = 0.0
    observed = np.zeros_like(depth)
    observed[60:80] = 0.7 * depth[60:80]
    observed[80:100] = 1.01 * depth[80:100]
    plain = capture_trust(depth, None, SETTINGS)
    trust = capture_trust(depth, observed, SETTINGS)
    assert not trust[:10].any()
    assert (trust[60:80] <= 0.05 * plain[60:80]).all()
    np.testing.assert_array_equal(trust[80:], plain[80:])
    np.testing.assert_array_equal(trust[10:60], plain[10:60])
