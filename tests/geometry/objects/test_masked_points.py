"""Points are an object's where most captures that see them show them in its masks."""

import numpy as np
import pytest

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.objects.masked_points import points_on_object

POINTS = np.array([[0.0, 0.0, 0.0], [0.4, 0.4, 0.0]])


@pytest.fixture
def views():
    """Three cameras around the origin, and masks of what is near it."""
    centres = ([2.0, 0.0, 1.0], [-1.0, 2.0, 1.0], [-1.0, -2.0, 1.0])
    cameras = [Camera(40, 30, 40.0, 40.0, 20.0, 15.0, look_at(np.array(centre), np.zeros(3))) for centre in centres]
    mask = np.zeros((30, 40), bool)
    mask[13:18, 18:23] = True
    return cameras, [mask] * 3


def test_points_in_most_masks_are_the_objects(views):
    cameras, masks = views
    assert all(camera.sees(*camera.project(POINTS)).all() for camera in cameras)
    seen = np.ones((2, 3), bool)
    assert points_on_object(POINTS, seen, cameras, masks, range(3)).tolist() == [True, False]
    nothing = np.zeros_like(masks[0])
    assert points_on_object(POINTS, seen, cameras, [masks[0], masks[1], nothing], range(3))[0]
    assert not points_on_object(POINTS, seen, cameras, [masks[0], nothing, nothing], range(3)).any()
    half = points_on_object(POINTS, seen, cameras[:2], [masks[0], nothing], range(2))
    assert not half.any()


def test_captures_that_do_not_see_a_point_say_nothing_of_it(views):
    cameras, masks = views
    seen = np.zeros((2, 5), bool)
    assert not points_on_object(POINTS, seen, cameras, masks, (0, 2, 4)).any()
    seen[0, 2] = True  # by the second of the three alone
    assert points_on_object(POINTS, seen, cameras, masks, (0, 2, 4)).tolist() == [True, False]
