"""Which plane completes a pixel, where the photographs themselves do not tell: the evidence one by one."""

import numpy as np
import pytest

from r2sego_blender.captures.capture import Capture
from r2sego_blender.config.settings import Settings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.room.completed_depth import DepthSource
from r2sego_blender.geometry.room.completion import complete_depth, trusted_depth
from r2sego_blender.geometry.room.planes import RoomPlanes
from r2sego_blender.geometry.stereo.stereo import DepthMap

SETTINGS = Settings()
LENS = Camera(80, 60, 70.0, 70.0, 40.0, 30.0, np.eye(4))
AHEAD = LENS.at(look_at((0.0, 0.0, 1.0), (0.0, 3.0, 1.0)))
WALL_M = 3.0


def depth_map(camera, depth_m):
    """Certain depth, a number or (H, W), 0 where there is none."""
    depth = np.broadcast_to(np.float32(depth_m), camera.shape).copy()
    normal = np.broadcast_to(-camera.forward.astype(np.float32), (*camera.shape, 3)).copy()
    support = np.full(camera.shape, 2, np.uint8)
    return DepthMap(depth, normal, np.full(camera.shape, 0.05, np.float32), support, camera)


def upright(*places_m, bounding):
    """Planes y = ``places_m`` that face the camera."""
    count = len(places_m)
    return RoomPlanes(
        np.tile([0.0, -1.0, 0.0], (count, 1)), -np.array(places_m), np.full(count, 100), np.array(bounding)
    )


@pytest.fixture
def blind(tmp_path):
    """Three captures at one place: no depth, and photographs that are alike on every plane."""
    save_image(tmp_path / "a.png", np.random.default_rng(0).random((60, 80, 3)).astype(np.float32))
    return [Capture(name, tmp_path / "a.png", AHEAD) for name in "abc"]


def chosen_m(captures, maps, planes):
    """The middle of the first capture's completed depth, and where most of it is from."""
    view = complete_depth(captures, maps, planes, SETTINGS)[0]
    return float(np.median(view.depth[20:40, 30:50])), DepthSource(int(np.median(view.source[20:40, 30:50])))


def test_no_plane_is_taken_behind_the_rooms_envelope(blind):
    maps = [depth_map(AHEAD, 0.0) for _ in blind]
    for behind_m, taken_m in ((WALL_M + 0.5, WALL_M), (WALL_M - 0.5, WALL_M - 0.5)):
        planes = upright(behind_m, WALL_M, bounding=[False, True])
        assert chosen_m(blind, maps, planes) == (pytest.approx(taken_m, abs=1e-3), DepthSource.PLANE)


def test_a_plane_that_another_capture_sees_through_is_not_taken(blind):
    """It looks along the nearer plane, far to the side of what the others show."""
    aside = LENS.at(look_at((-4.0, 1.5, 1.0), (0.0, 1.6, 1.0)))
    captures = [*blind, Capture("aside", blind[0].image_path, aside)]
    planes = upright(1.6, WALL_M, bounding=[False, True])
    for seen_m, taken_m in ((0.0, 1.6), (12.0, WALL_M)):
        maps = [*(depth_map(AHEAD, 0.0) for _ in blind), depth_map(aside, seen_m)]
        assert chosen_m(captures, maps, planes)[0] == pytest.approx(taken_m, abs=1e-3)


@pytest.mark.parametrize(
    ("agree", "through", "trusted"), [(1, 0, True), (0, 0, True), (0, 1, False), (2, 1, False), (3, 1, True)]
)
def test_a_witness_against_a_depth_outweighs_two_for_it(agree, through, trusted):
    maps = [depth_map(AHEAD, depth) for depth in (2.0, *agree * (2.0,), *through * (4.0,))]
    assert (trusted_depth(maps, SETTINGS.stereo)[0].depth == (2.0 if trusted else 0.0)).all()


def test_what_another_capture_measured_is_taken_before_the_envelope(tmp_path):
    """Bare photographs, and no plane of the room where the other capture sees something."""
    save_image(tmp_path / "bare.png", np.full((60, 80, 3), 0.5, np.float32))
    beside = LENS.at(look_at((0.4, 0.0, 1.0), (0.4, 3.0, 1.0)))
    captures = [Capture("a", tmp_path / "bare.png", AHEAD), Capture("beside", tmp_path / "bare.png", beside)]
    planes = upright(WALL_M, bounding=[True])
    for seen_m, taken_m, source in ((0.0, WALL_M, DepthSource.ENVELOPE), (2.0, 2.0, DepthSource.FILLED)):
        maps = [depth_map(AHEAD, 0.0), depth_map(beside, seen_m)]
        assert chosen_m(captures, maps, planes) == (pytest.approx(taken_m, abs=1e-3), source)
