import numpy as np
import pytest
from furnished_rooms import around, furnished_room, write_captures

from r2sego_blender.geometry.layout.layout_depth import layout_depth
from r2sego_blender.geometry.stereo.evidence import KnownDepth

ROOMS = (12, 17)


@pytest.fixture(scope="module", params=ROOMS)
def estimated(request, tmp_path_factory):
    """What the layout says of a room, and its exact depth."""
    room = furnished_room(request.param)
    cameras = around(room, np.random.default_rng(request.param + 1000))
    captures, depths = write_captures(tmp_path_factory.mktemp("room"), room, cameras)
    nothing = [KnownDepth(camera, np.zeros(camera.shape, np.float32)) for camera in cameras]
    return layout_depth(captures, nothing), depths


def test_most_pixels_are_within_a_tenth_and_the_floor_is_exact(estimated):
    found, depths = estimated
    off = np.concatenate([np.abs(one.depth / true - 1.0).ravel() for one, true in zip(found, depths, strict=True)])
    assert (off < 0.1).mean() > 0.7
