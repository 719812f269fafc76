"""What GaussGym's loader asks of a folder: its conditions, written anew, hold for the path and mesh of an export."""

from __future__ import annotations

import json

import numpy as np
import pytest
from consumer_rooms import exported_room
from expected_errors import refused
from scipy import interpolate, signal

from r2sego_blender.core.errors import RobotError
from r2sego_blender.results.consumers.gaussgym import CONSUMER, MESH, SPLAT, TRANSFORMS, camera_path, is_kept
from r2sego_blender.robot.planning.free_floor import FreeFloor
from r2sego_blender.splats.formats.registry import load_asset


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gaussgym")
    room = exported_room(tmp_path_factory.mktemp("room"))
    CONSUMER.write(room, folder)
    return folder, room


def loaded_path(poses: np.ndarray) -> np.ndarray:
    """As its loader smooths and resamples ``cam_trans``: Savitzky and Golay's filter, then smoothing splines."""
    smooth = signal.savgol_filter(poses, 11, 2, axis=0)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(smooth, axis=0), axis=1))])
    splines = [interpolate.splrep(along / along[-1], smooth[:, axis], k=3, s=1) for axis in range(3)]
    return np.stack([interpolate.splev(np.linspace(0.0, 1.0, 30), one) for one in splines], axis=1)


def hits(origins: np.ndarray, upward: float, corners: np.ndarray) -> np.ndarray:
    """(R,) distances along z to the nearest triangle from either side, inf without one (Moeller and Trumbore)."""
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    direction = np.array([0.0, 0.0, upward])
    across = np.cross(direction, ac)
    scale = (ab * across).sum(1)
    nearest = np.full(len(origins), np.inf)
    for index, origin in enumerate(origins):
        with np.errstate(divide="ignore", invalid="ignore"):
            u = ((origin - a) * across).sum(1) / scale
            turned = np.cross(origin - a, ab)
            v, t = (turned @ direction) / scale, (turned * ac).sum(1) / scale
            met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        nearest[index] = t[met].min(initial=np.inf)
    return nearest


def test_the_loader_keeps_the_whole_path(written):
    folder, _ = written
    with np.load(folder / MESH) as told:
        mesh = {name: told[name] for name in told.files}
    assert np.unique(mesh["cam_trans"], axis=0).shape[0] >= 11
    assert mesh["offset"].shape == (1, 3) and not mesh["offset"].any()
    assert np.array_equal(mesh["from_ig_rotation"], np.eye(3)) and mesh["cam_quat"].shape == (1000, 4)
    corners = mesh["vertices"].astype(np.float32)[mesh["triangles"].astype(np.uint32)].astype(np.float64)
    grid = np.linspace(-0.25, 0.25, 20)
    disc = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    disc = disc[np.linalg.norm(disc, axis=1) <= 0.25]
    path = loaded_path(mesh["cam_trans"])
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).min() > 0.01  # headings come from the differences
    for pose in path[::6]:
        starts = pose + np.column_stack([disc, np.zeros(len(disc))])
        assert np.isfinite(hits(starts, -1.0, corners)).all()
        assert hits(starts, 1.0, corners).min() > 2.0


def test_the_ceiling_is_left_out_and_furniture_is_not(written):
    folder, _ = written
    with np.load(folder / MESH) as told:
        heights = told["vertices"][told["triangles"]][:, :, 2]
    assert not (heights.min(axis=1) > 2.4).any()  # the ceiling is at 2.5 m
    assert ((heights.min(axis=1) > 0.5) & (heights.max(axis=1) < 0.8)).any()  # the table's top


def test_splats_and_their_transform_are_the_worlds(written):
    folder, room = written
    assert np.array_equal(load_asset(folder / SPLAT).means, room.asset.means)
    told = json.loads((folder / TRANSFORMS).read_text())
    assert told == {"transform": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], "scale": 1.0}


def test_a_pose_under_a_lamp_or_over_a_hole_is_none():
    floor = np.array([[(-9, -9, 0), (9, -9, 0), (0, 9, 0)]], np.float64)
    lamp = np.array([[(0.2, -1, 2), (0.2, 1, 2), (3, 0, 2)]], np.float64)
    at = np.array([0.0, 0.0, 1.2])
    assert is_kept(at, floor)
    assert not is_kept(at, np.concatenate([floor, lamp])) and is_kept(at - (0.5, 0, 0), np.concatenate([floor, lamp]))
    assert not is_kept(at, lamp - (0.0, 0.0, 2.0))


def test_a_floor_too_small_to_move_on_is_refused():
    free = np.zeros((5, 5), bool)
    free[2, 1:4] = True
    floor = FreeFloor(np.zeros(2), free, free, 0.05 * free, 0.0)
    with refused(RobotError, "collision", "m to move"):
        camera_path(floor, np.array([[(-9, -9, 0), (9, -9, 0), (0, 9, 0)]], np.float64), "collision")
