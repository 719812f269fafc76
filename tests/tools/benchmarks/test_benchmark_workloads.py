"""Workloads: the made-up room is one, and files are taken as they are."""

import numpy as np
import pytest
from cameras_file import save_cameras_json

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import R2SEgoError, SettingsError
from r2sego_blender.core.images import save_image
from r2sego_blender.splats.formats.registry import save_asset
from r2sego_blender.splats.rendering.rasterizer import render
from tools.benchmarks.workloads import made_up_room, of_files, parse_size


def test_a_size_is_width_by_height():
    assert parse_size("640x480") == (640, 480) == parse_size("640X480")


@pytest.mark.parametrize("text", ["640", "640x", "x", "0x480", "-3x4", "6.5x3", "640x480x3", "²x4", "99999x9"])
def test_what_is_no_size_is_said(text):
    with pytest.raises(SettingsError, match="640x480"):
        parse_size(text)


def test_the_room_is_flat_closed_and_the_same_each_time():
    room, again = made_up_room(3000, (80, 60), seed=1), made_up_room(3000, (80, 60), seed=1)
    asset = room.asset
    assert len(asset) == 3000 and asset.degree == 3
    np.testing.assert_array_equal(asset.sh, again.asset.sh)
    np.testing.assert_array_equal(room.views[0].image(), again.views[0].image())
    assert not np.array_equal(made_up_room(3000, (80, 60), seed=2).asset.means, asset.means)
    scales = np.sort(np.exp(asset.log_scales), axis=1)
    assert (scales[:, 0] < 0.11 * scales[:, 1]).all()  # flat ...
    assert np.median(scales[:, 2] / scales[:, 1]) > 1.2  # ... and long
    assert render(asset, room.views[0].camera).alpha.mean() > 0.9  # walls on all sides


@pytest.fixture
def files(tmp_path):
    room = made_up_room(300, (80, 60))
    lens = room.views[0].camera
    save_asset(tmp_path / "asset.ply", room.asset)
    captures = []
    for index in range(3):
        path = tmp_path / f"{index}.png"
        save_image(path, room.views[0].image())
        pose = look_at(np.array([-1.0 + 0.3 * index, 1.2, 1.5]), np.array([0.5, 0.0, 0.8]))
        captures.append(Capture(path.name, path, lens.at(pose)))
    save_cameras_json(tmp_path / "cameras.json", captures)
    save_cameras_json(tmp_path / "frozen.json", captures[:1], frozen=captures[1:])
    return tmp_path


def test_frozen_views_are_taken_and_else_captures(files):
    workload = of_files(files / "asset.ply", files / "frozen.json")
    assert len(workload.views) == 2 and len(workload.asset) == 300
    assert len(of_files(files / "asset.ply", files / "cameras.json").views) == 3
    camera = workload.views[0].camera
    assert camera.shape == (60, 80) and workload.views[0].image().shape == (60, 80, 3)


def test_views_are_scaled_to_a_size_of_their_shape(files):
    view = of_files(files / "asset.ply", files / "cameras.json", (40, 30)).views[0]
    whole = of_files(files / "asset.ply", files / "cameras.json").views[0].camera
    assert isinstance(view.camera, Camera) and view.image().shape == (30, 40, 3)
    point = np.array([0.5, 0.0, 0.8])
    np.testing.assert_allclose(view.camera.project(point)[0] * 2, whole.project(point)[0])
    with pytest.raises(SettingsError, match="80x60"):
        of_files(files / "asset.ply", files / "cameras.json", (40, 40))


def test_files_that_are_not_there_are_named(files):
    with pytest.raises(R2SEgoError, match=r"none\.ply"):
        of_files(files / "none.ply", files / "cameras.json")
    with pytest.raises(R2SEgoError, match=r"none\.json"):
        of_files(files / "asset.ply", files / "none.json")
