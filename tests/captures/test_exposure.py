"""One exposure for all captures: found where they differ, and none where they agree."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from expected_errors import refused
from measured_points import measured

from r2sego_blender.captures.exposure import exposure_gains_of
from r2sego_blender.captures.sensors.sensor_maps import SensorMap
from r2sego_blender.captures.store import load_captures, save_captures
from r2sego_blender.core.colours import linear_from_srgb, srgb_from_linear
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import load_image, save_image, to_uint8
from r2sego_blender.core.json_files import write_json

EXPOSURES = np.array([[0.7, 0.65, 0.6], [1.0, 1.0, 1.05], [1.2, 1.25, 1.3], [0.9, 1.0, 1.1], [1.1, 0.95, 0.9]])


@pytest.fixture(scope="module")
def sparse(room, room_cameras):
    """Points of the room, each where all that see it project it: what triangulation would give at its best."""
    rng = np.random.default_rng(3)
    first = room_cameras[2]
    pixels = rng.uniform((4, 4), (396, 296), (400, 2))
    depth = room.depth(first)[pixels[:, 1].astype(int), pixels[:, 0].astype(int)]
    rays = np.column_stack([(pixels - [first.cx, first.cy]) / [first.fx, first.fy], np.ones(len(pixels))])
    points = (rays * depth[:, None]) @ first.world_from_camera[:3, :3].T + first.centre
    return measured(points, room_cameras)


@pytest.fixture
def exposed(room_captures, tmp_path):
    """The captures with other exposures and white balances, in files of their own."""
    found = []
    for capture, exposure in zip(room_captures, EXPOSURES, strict=True):
        dimmed = 0.6 * linear_from_srgb(capture.image())  # so that nothing is clipped
        path = tmp_path / capture.name
        save_image(path, srgb_from_linear(dimmed * exposure))
        found.append(replace(capture, image_path=path))
    return found


def sensed(captures, depths):
    """What a sensor without errors saw of each capture."""
    return {
        capture.name: SensorMap(depth.astype(np.float32), np.full(depth.shape, 0.01, np.float32), capture.camera)
        for capture, depth in zip(captures, depths, strict=True)
    }


def test_captures_of_one_exposure_have_no_gain(room_captures, sparse):
    assert exposure_gains_of(room_captures, sparse) == [None] * len(room_captures)


def test_a_surface_that_shines_changes_no_exposure(room_captures, sparse, tmp_path):
    """A quarter of the points is twice as bright in one capture."""
    bright = room_captures[1].image()
    bright[:, :100] = np.clip(1.6 * bright[:, :100], 0.0, 1.0)
    save_image(tmp_path / "bright.png", bright)
    captures = [*room_captures]
    captures[1] = replace(captures[1], image_path=tmp_path / "bright.png")
    assert exposure_gains_of(captures, sparse) == [None] * len(captures)


def test_exposures_and_white_balances_are_found_up_to_their_mean(exposed, sparse):
    gains = np.array(exposure_gains_of(exposed, sparse))
    assert np.log(gains).mean(axis=0) == pytest.approx(0.0, abs=1e-5)
    even = gains * EXPOSURES
    assert even / np.exp(np.log(even).mean(axis=0)) == pytest.approx(1.0, abs=0.02)


def test_clipped_pixels_say_nothing_of_exposure(room_captures, sparse, tmp_path):
    """Part of a capture is white, for twice the light; the rest tells by how much."""
    linear = 2.0 * linear_from_srgb(room_captures[2].image())
    assert 0.05 < (linear >= 1.0).any(axis=2).mean() < 0.9
    save_image(tmp_path / "bright.png", srgb_from_linear(np.clip(linear, 0.0, 1.0)))
    captures = [*room_captures]
    captures[2] = replace(captures[2], image_path=tmp_path / "bright.png")
    gains = np.array(exposure_gains_of(captures, sparse))
    np.testing.assert_allclose(gains[0] / gains[2], 2.0, rtol=0.05)


def test_captures_that_no_track_links_are_brought_to_one_exposure(exposed, sparse):
    """Half of the points are matched in two captures, half in the other three; all show nearly all of them."""
    linked = np.zeros_like(sparse.visibility)
    linked[::2, :2], linked[1::2, 2:] = True, True
    apart = replace(sparse, visibility=sparse.visibility & linked)
    even = np.array(exposure_gains_of(exposed, apart)) * EXPOSURES
    assert even / np.exp(np.log(even).mean(axis=0)) == pytest.approx(1.0, abs=0.03)


def test_a_sensor_links_captures_of_which_no_point_is_known(exposed, room, room_cameras):
    none = measured(np.zeros((0, 3)), room_cameras)
    maps = sensed(exposed, [room.depth(camera) for camera in room_cameras])
    even = np.array(exposure_gains_of(exposed, none, maps)) * EXPOSURES
    assert even / np.exp(np.log(even).mean(axis=0)) == pytest.approx(1.0, abs=0.03)


def test_what_a_sensor_saw_before_the_points_tells_no_exposure(exposed, room, room_cameras, sparse, tmp_path):
    """A dark board covers most of a capture; its sensor saw it, 0.4 m before the camera."""
    board = np.zeros(room_cameras[1].shape, bool)
    board[:, :280] = True
    image = np.where(board[..., None], np.float32([0.2, 0.1, 0.1]), exposed[1].image())
    save_image(tmp_path / "board.png", image)
    captures = [*exposed]
    captures[1] = replace(captures[1], image_path=tmp_path / "board.png")
    seen = sparse.visibility.copy()
    pixels = np.nan_to_num(sparse.pixels[:, 1]).astype(int)
    seen[board[pixels[:, 1], pixels[:, 0]], 1] = False
    sparse = replace(sparse, visibility=seen)
    depths = [room.depth(camera) for camera in room_cameras]
    depths[1] = np.where(board, np.float32(0.4), depths[1])
    even = np.array(exposure_gains_of(captures, sparse, sensed(captures, depths))) * EXPOSURES
    assert even / np.exp(np.log(even).mean(axis=0)) == pytest.approx(1.0, abs=0.03)


def test_another_surface_before_the_points_changes_no_exposure(room_captures, sparse, tmp_path):
    """A wall of one colour stands before a third of a capture's points, and no sensor tells."""
    image = room_captures[3].image()
    image[:, :140] = (0.7, 0.3, 0.25)
    save_image(tmp_path / "wall.png", image)
    captures = [*room_captures]
    captures[3] = replace(captures[3], image_path=tmp_path / "wall.png")
    seen = sparse.visibility.copy()
    seen[np.nan_to_num(sparse.pixels[:, 3, 0]) < 140.0, 3] = False
    assert exposure_gains_of(captures, replace(sparse, visibility=seen)) == [None] * len(captures)


def test_what_is_corrected_is_alike_and_the_files_stay_as_taken(exposed, room_captures, sparse, tmp_path):
    gains = exposure_gains_of(exposed, sparse)
    given = [replace(capture, gain=gain) for capture, gain in zip(exposed, gains, strict=True)]
    stored = save_captures(tmp_path / "bundle", given, sparse)
    loaded = load_captures(tmp_path / "bundle")
    assert [capture.gain for capture in loaded] == gains
    mean = np.exp(np.log(EXPOSURES).mean(axis=0))
    for capture, saved, original, room in zip(loaded, stored, exposed, room_captures, strict=True):
        as_taken = load_image(capture.image_path)
        assert (as_taken == load_image(original.image_path)).all()
        assert (saved.image() == capture.image()).all()
        truth = srgb_from_linear(0.6 * linear_from_srgb(room.image()) * mean)
        assert np.abs(capture.image() - truth).mean() < 0.008
        assert np.abs(capture.image() - truth).mean() < np.abs(as_taken - truth).mean() + 1e-3


def test_a_capture_without_a_gain_is_as_it_was_to_the_bit(room_captures, tmp_path):
    save_captures(tmp_path, room_captures)
    for capture, loaded in zip(room_captures, load_captures(tmp_path), strict=True):
        assert (loaded.image() == loaded.as_taken()).all() and (
            to_uint8(loaded.image()) == to_uint8(capture.image())
        ).all()
    assert (
        "gain" not in (tmp_path / "cameras.json").read_text()
        and "weight" not in (tmp_path / "cameras.json").read_text()
    )


@pytest.mark.parametrize(
    "entry", [{"exposure_gain": [1.0, 2.0]}, {"exposure_gain": [0.0, 1.0, 1.0]}, {"weight": 0.0}, {"weight": 7.0}]
)
def test_gains_and_weights_that_are_none_are_refused(room_captures, tmp_path, entry):
    save_captures(tmp_path, room_captures)
    data = json.loads((tmp_path / "cameras.json").read_text())
    data["captures"][2] |= entry
    write_json(tmp_path / "cameras.json", data)
    with refused(CaptureError, "captures[2]", "damaged"):
        load_captures(tmp_path)
