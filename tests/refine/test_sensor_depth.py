"""A bundle from photographs and a depth sensor: measured from the files to the proxy, and named so."""

from __future__ import annotations

import numpy as np
import pytest
from box_room import ROOM, TABLE, lens, texture, write_captures
from cameras_file import save_cameras_json

from r2sego_blender.captures.frame.scale import Scale
from r2sego_blender.captures.sensors.sensor_maps import SENSOR_DEPTH
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import look_at
from r2sego_blender.geometry.proxy.proxy import PROXY, Provenance
from r2sego_blender.geometry.stereo.observed_geometry import OBSERVED
from r2sego_blender.geometry.stereo.stereo import DEPTH
from r2sego_blender.pipeline import refine
from r2sego_blender.refine.creation import create_scene

pytestmark = pytest.mark.slow

SMALL = {"stereo.max_side_px": 160, "stereo.iterations": 2, "stereo.levels": 2, "proxy.voxel_m": 0.05}
UNIT_M = 1 / 4000


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Six photographs of a textured room whose far wall is bare, with whole numbers of a quarter millimetre."""
    folder = tmp_path_factory.mktemp("sensor")
    around = np.linspace(-0.5, 0.5, 6)
    places = [np.array([1.6 * np.sin(a), -1.6 * np.cos(a), 1.4]) for a in around]
    cameras = [lens(320, 240).at(look_at(place, [0.0, 0.5, 0.6])) for place in places]
    (folder / "photos").mkdir()
    captures, depths = write_captures(folder / "photos", cameras, colour=_bare)
    save_cameras_json(folder / "photos" / "cameras.json", captures, metric=False)
    for capture, depth in zip(captures, depths, strict=True):
        save_depth(folder / "depth" / f"{capture.image_path.stem}.npy", depth)
    made = create_scene(
        folder / "room.r2s",
        folder / "photos",
        folder / "photos" / "cameras.json",
        scale=Scale.depth(folder / "depth", UNIT_M),
        settings=CaptureSettings(max_side_px=320),
    ).declare(overrides=SMALL)
    refine(made, until=PROXY.of_round(0).name)
    return made


def _bare(points: np.ndarray) -> np.ndarray:
    """The room's texture, but for a wall without any."""
    return np.where((points[..., 1:2] > ROOM[1][1] - 0.01), 0.6, texture(points))


def save_depth(path, depth_m: np.ndarray) -> None:
    path.parent.mkdir(exist_ok=True)
    np.save(path, np.rint(depth_m / UNIT_M).astype(np.uint16))


def test_the_sensors_metre_is_the_worlds_and_its_maps_are_the_captures(scene):
    captures = scene.read(CAPTURES)
    for index, capture in enumerate(captures):
        one = scene.read(SENSOR_DEPTH).found(captures, index)
        assert np.allclose(one.camera.world_from_camera, capture.camera.world_from_camera)
        assert (one.depth > 0.0).mean() > 0.9
    assert "sensor" in scene.declaration.backends["initial_asset"]
    assert np.isclose(captures[0].camera.centre[2], 1.4, atol=0.03)


def test_the_bare_wall_is_measured_and_the_textured_table_seen(scene):
    maps = scene.read(DEPTH).of(scene.read(CAPTURES))
    h = scene.declaration.settings.stereo
    world = np.array(scene.declaration.world_from_capture)
    for one in maps:
        inverse = np.linalg.inv(world)
        own = one.camera.unproject(one.depth) @ inverse[:3, :3].T + inverse[:3, 3]
        wall = (np.abs(own[..., 1] - ROOM[1][1]) < 0.05) & (one.depth > 0.0)
        assert wall.mean() > 0.1 and one.reliable(h).mean() > 0.9
        assert one.measured[wall].mean() > 0.7
    observed = scene.read(OBSERVED)
    assert 0.05 < observed.measured.mean() < 0.95


def test_faces_of_the_proxy_say_what_measured_them_and_lie_right(scene):
    proxy = scene.read(PROXY.of_round(0))
    areas = np.bincount(proxy.provenance, minlength=len(Provenance))
    assert areas[Provenance.MEASURED] > 100 and areas[Provenance.OBSERVED] > 100
    inverse = np.linalg.inv(np.array(scene.declaration.world_from_capture))
    centres = proxy.vertices[proxy.faces].mean(axis=1) @ inverse[:3, :3].T + inverse[:3, 3]
    off = np.abs(_distance(centres[proxy.provenance == Provenance.MEASURED]))
    assert np.quantile(off, 0.95) < 0.04


def _distance(points: np.ndarray) -> np.ndarray:
    """Of points from the surface of the room or of the table."""
    room = np.minimum(points - ROOM[0], ROOM[1] - points).min(axis=1)
    outside = np.maximum(np.maximum(TABLE[0] - points, points - TABLE[1]), 0.0)
    inside = np.minimum(points - TABLE[0], TABLE[1] - points).min(axis=1)
    table = np.where(inside > 0.0, inside, np.linalg.norm(outside, axis=1))
    return np.minimum(np.abs(room), table)
