import numpy as np
import pytest
from furnished_rooms import around, furnished_room, write_captures
from progress_recorder import ProgressRecorder

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.layout.layout_depth import layout_depth
from r2sego_blender.geometry.layout.segments import find_segments, level_turn
from r2sego_blender.geometry.stereo.evidence import KnownDepth

ROOMS = (4, 17)


def nothing_known(cameras):
    return [KnownDepth(camera, np.zeros(camera.shape, np.float32)) for camera in cameras]


@pytest.fixture(scope="module")
def estimated(tmp_path_factory):
    """For each room what the layout says, the exact depth and the cameras."""
    found = []
    for seed in ROOMS:
        room = furnished_room(seed)
        cameras = around(room, np.random.default_rng(seed + 1000))
        captures, depths = write_captures(tmp_path_factory.mktemp("room"), room, cameras)
        found.append((room, captures, layout_depth(captures, nothing_known(cameras)), depths))
    return found
