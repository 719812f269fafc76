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


def test_most_pixels_are_near_the_truth(estimated):
    for _, _, found, depths in estimated:
        off = np.concatenate([np.abs(one.depth / true - 1.0).ravel() for one, true in zip(found, depths, strict=True)])
        assert (off < 0.05).mean() > 0.6
        assert (off < 0.25).mean() > 0.8


def test_the_floor_is_within_five_centimetres(estimated):
    for _, captures, found, depths in estimated:
        off = [
            one.camera.unproject(one.depth)[capture.camera.unproject(true)[..., 2] < 0.005][:, 2]
            for capture, one, true in zip(captures, found, depths, strict=True)
        ]
        assert (np.abs(np.concatenate(off)) < 0.05).mean() > 0.85


def test_its_uncertainty_is_honest(estimated):
    off = np.concatenate(
        [
            (np.abs(one.depth / true - 1.0) / one.sigma).ravel()
            for _, _, found, depths in estimated
            for one, true in zip(found, depths, strict=True)
        ]
    )
    assert [(off < sigmas).mean() > share for sigmas, share in ((1, 0.65), (2, 0.8), (3, 0.85))] == [True] * 3


def test_every_pixel_has_depth_and_is_unsure(estimated):
    for _, captures, found, _ in estimated:
        for capture, one in zip(captures, found, strict=True):
            assert one.depth.dtype == one.sigma.dtype == np.float32
            assert one.depth.shape == one.sigma.shape == capture.camera.shape
            assert (one.depth > 0.0).all() and np.isfinite(one.depth).all() and (one.sigma >= 0.01).all()


def test_the_turn_of_the_room_is_found(estimated):
    for room, captures, _, _ in estimated:
        turn, _ = level_turn(find_segments([one.image() for one in captures], [one.camera for one in captures]))
        off = np.mod(turn - room.yaw + np.pi / 4, np.pi / 2) - np.pi / 4
        assert abs(np.degrees(off)) < 0.5


def test_without_edges_the_floor_is_kept_and_walls_are_unsure(tmp_path):
    room = furnished_room(ROOMS[0])
    cameras = around(room, np.random.default_rng(5), count=3)
    path = tmp_path / "grey.png"
    save_image(path, np.full((*cameras[0].shape, 3), 0.5, np.float32))
    progress = ProgressRecorder()
    found = layout_depth(
        [Capture(f"{k}", path, one) for k, one in enumerate(cameras)], nothing_known(cameras), progress
    )
    assert len(progress.warnings) == 1
    for one in found:
        level = one.camera.unproject(one.depth)[..., 2] < 1e-4
        assert level.any() and not level.all()
        assert (one.sigma[~level] > 0.1).all()
