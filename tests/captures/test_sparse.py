"""Sparse points of a room whose surfaces are known."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
from expected_errors import refused

from r2sego_blender.captures.frame.scale import Scale
from r2sego_blender.captures.frame.world_frame import register
from r2sego_blender.captures.importing import Imported, import_captures
from r2sego_blender.captures.matching.features import sift
from r2sego_blender.captures.solving.locating import landmarks, locate, locate_views
from r2sego_blender.captures.sparse import depth_ranges, poorly_matched, triangulate
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.captures.store import load_captures, save_captures
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import rotation_angle_rad
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import save_image

SETTINGS = CaptureSettings(max_features=1500)


@pytest.fixture(scope="module")
def sparse(room_captures):
    return triangulate(room_captures, SETTINGS)


def _off_surface_m(points, bounds):
    distance = np.minimum(np.abs(points - bounds[0]), np.abs(points - bounds[1]))
    return distance.min(axis=1)


def test_points_lie_on_the_surfaces_and_project_where_they_were_measured(sparse, room_captures, room_bounds):
    assert len(sparse.points) > 300
    off_m = _off_surface_m(sparse.points, room_bounds)
    assert np.median(off_m) < 0.01 and (off_m < 0.05).mean() > 0.9
    assert sparse.colours.dtype == np.uint8 and sparse.colours.shape == sparse.points.shape
    assert (sparse.visibility.sum(axis=1) >= 2).all()
    for index, capture in enumerate(room_captures):
        seen = sparse.visibility[:, index]
        pixels, depth = capture.camera.project(sparse.points[seen])
        error_px = np.linalg.norm(pixels - sparse.pixels[seen, index], axis=1)
        assert error_px.max() < SETTINGS.max_error_px + 0.01 and (depth > 0).all()
        assert np.isnan(sparse.pixels[~seen, index]).all()


def test_the_same_captures_give_the_same_bytes_in_any_folder(sparse, room_captures, tmp_path, elsewhere):
    elsewhere()
    again = triangulate(room_captures, SETTINGS)
    sparse.save(tmp_path / "a.npz")
    again.save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    loaded = SparsePoints.load(tmp_path / "a.npz")
    assert np.array_equal(loaded.pixels, sparse.pixels, equal_nan=True)
    assert np.array_equal(loaded.points, sparse.points)


def test_depth_ranges_hold_what_each_capture_sees(sparse, room_captures, room):
    for capture, (near, far) in zip(room_captures, depth_ranges(room_captures, sparse), strict=True):
        depth = room.depth(capture.camera)
        assert 0 < near < far
        assert ((depth > near) & (depth < far)).mean() > 0.95


def test_poses_that_contradict_the_photographs_are_told_from_no_overlap(room_captures, tmp_path, rng):
    opengl = [
        replace(c, camera=c.camera.at(c.camera.world_from_camera @ np.diag([1.0, -1, -1, 1]))) for c in room_captures
    ]
    with refused(CaptureError, "camera poses", cure="axis convention"):
        triangulate(opengl, SETTINGS)
    swapped = [replace(room_captures[i], camera=room_captures[j].camera) for i, j in ((0, 4), (2, 1), (4, 2))]
    with refused(CaptureError, "camera poses", cure="axis convention"):
        triangulate(swapped, SETTINGS)
    strangers = []
    for index, capture in enumerate(room_captures[:3]):
        path = tmp_path / f"{index}.png"
        save_image(path, rng.random((150, 200, 3)).astype(np.float32))
        strangers.append(replace(capture, image_path=path))
    with refused(CaptureError, "captures", cure="overlap by half"):
        triangulate(strangers, SETTINGS)


def test_a_capture_that_sees_nothing_of_the_others_is_named(room_captures, tmp_path, messages):
    save_image(tmp_path / "grey.png", np.full((300, 400, 3), 0.5, np.float32))
    captures = [*room_captures[:3], replace(room_captures[3], image_path=tmp_path / "grey.png")]
    triangulate(captures, SETTINGS, messages)
    assert len(messages.warnings) == 1 and "photo3.png" in messages.warnings[0]


def test_the_room_is_registered_to_its_floor(sparse, room_captures):
    imported = Imported(tuple(room_captures), "test", metric=True)
    registration = register(imported, sparse, Scale(), SETTINGS)
    world = registration.captures(room_captures)
    assert np.abs(world[0].camera.centre - [0, 0, 1.5]).max() < 0.01
    heading = world[0].camera.forward
    assert abs(heading[1]) < 1e-9 and heading[0] > 0
    up = registration.world_from_capture[2, :3]
    assert np.degrees(np.arccos(up[2])) < 0.3
    assert "floor plane" in registration.ground


def test_captures_are_stored_and_loaded(sparse, room_captures, tmp_path):
    import pycolmap

    stored = save_captures(tmp_path / "a", room_captures, sparse)
    save_captures(tmp_path / "b", room_captures, sparse)
    for file in sorted((tmp_path / "a").rglob("*")):
        if file.is_file():
            twin = tmp_path / "b" / file.relative_to(tmp_path / "a")
            assert file.read_bytes() == twin.read_bytes(), file.name
    loaded = load_captures(tmp_path / "a")
    assert [c.camera.to_json() for c in loaded] == [c.camera.to_json() for c in room_captures]
    assert [(c.name, c.image_path) for c in loaded] == [(c.name, c.image_path) for c in stored]
    assert np.array_equal(loaded[1].image(), room_captures[1].image())
    imported = import_captures(tmp_path / "a", tmp_path / "a" / "sparse", SETTINGS)
    for capture, original in zip(imported.captures, room_captures, strict=True):
        assert np.abs(capture.camera.world_from_camera - original.camera.world_from_camera).max() < 1e-9
    model = pycolmap.Reconstruction(tmp_path / "a" / "sparse")
    assert model.num_points3D() == len(sparse.points)
    model.update_point_3d_errors()
    assert model.compute_mean_reprojection_error() == pytest.approx(sparse.error_px.mean(), abs=1e-3)


def test_damaged_stores_are_named(room_captures, tmp_path):
    save_captures(tmp_path, room_captures[:3])
    (tmp_path / "images" / "photo1.png").unlink()
    with refused(CaptureError, "images/photo1.png", cure="`r2sego new`"):
        load_captures(tmp_path)
    (tmp_path / "cameras.json").write_text('{"captures": [{"file": 3}]}')
    with refused(CaptureError, "cameras.json, captures[0]", cure="`r2sego new`"):
        load_captures(tmp_path)
    (tmp_path / "cameras.json").write_text('{"captures": []}')
    with refused(CaptureError, "cameras.json", "'captures'", cure="`r2sego new`"):
        load_captures(tmp_path)
    (tmp_path / "sparse.npz").write_bytes(b"PK")
    with refused(CaptureError, "sparse.npz", cure="`r2sego new`"):
        SparsePoints.load(tmp_path / "sparse.npz")
    short = np.zeros((1, 3), np.uint8)
    pixels = np.ones((2, 3, 2))
    points = SparsePoints(np.zeros((2, 3)), short, np.ones((2, 3), bool), np.ones(2), pixels)
    points.save(tmp_path / "sparse.npz")
    with refused(CaptureError, "sparse.npz", cure="`r2sego new`"):
        SparsePoints.load(tmp_path / "sparse.npz")


@pytest.mark.parametrize("dense", [False, True])
def test_held_out_photographs_are_located(sparse, room_captures, room, tmp_path, dense, messages):
    used = [0, 1, 2, 4]
    captures = [room_captures[i] for i in used]
    points = SparsePoints(
        sparse.points, sparse.colours, sparse.visibility[:, used], sparse.error_px, sparse.pixels[:, used]
    )
    held_out = room_captures[3]
    save_image(tmp_path / "held.png", held_out.image())
    shutil.copy(tmp_path / "held.png", tmp_path / "a copy of held.png")  # would count twice in every mean
    save_image(tmp_path / "grey.png", np.full((300, 400, 3), 0.5, np.float32))
    depths = [room.depth(c.camera)[::2, ::2] for c in captures] if dense else None
    found = locate_views(tmp_path, captures, points, SETTINGS, depths=depths, progress=messages)
    assert [view.name for view in found] == ["held.png"]
    assert "a copy of held.png" in messages.warnings[0] and "grey.png" in messages.warnings[1]
    assert np.linalg.norm(found[0].camera.centre - held_out.camera.centre) < 0.02
    pose, truth = found[0].camera.world_from_camera, held_out.camera.world_from_camera
    assert np.degrees(rotation_angle_rad(pose, truth)) < 0.3


def test_photographs_are_located_by_matches_as_clear_as_is_set(sparse, room_captures):
    held_out, known = room_captures[2], landmarks(room_captures[:2], sparse, SETTINGS)
    features = sift(held_out.image(), SETTINGS.max_features)
    strict, loose = (
        locate(features, held_out.camera, known, replace(SETTINGS, match_ratio=ratio), seed=0) for ratio in (0.5, 0.95)
    )
    assert 15 < len(strict.inliers) < 0.9 * len(loose.inliers)


def test_photographs_that_cannot_be_located_are_refused(sparse, room_captures, tmp_path):
    with refused(CaptureError, tmp_path, "no photographs"):
        locate_views(tmp_path, room_captures, sparse, SETTINGS)
    save_image(tmp_path / "tall.png", np.zeros((200, 100, 3), np.float32))
    with refused(CaptureError, "tall.png", "100x200"):
        locate_views(tmp_path, room_captures, sparse, SETTINGS)


@pytest.mark.slow
def test_sparse_points_of_the_furnished_room(shared):
    folder = shared("scenes/room_a")
    imported = import_captures(folder, folder / "cameras.json", CaptureSettings())
    sparse = triangulate(imported.captures, CaptureSettings())
    assert len(sparse.points) > 1500
    right = total = 0
    for index, capture in enumerate(imported.captures):
        with np.load(folder / "depth" / f"cap{index:02d}.npz") as truth:
            z = truth["z"]
        seen = sparse.visibility[:, index]
        column, row = np.floor(sparse.pixels[seen, index]).astype(int).T
        measured = capture.camera.project(sparse.points[seen])[1]
        true = z[np.clip(row, 0, 479), np.clip(column, 0, 639)]
        right += (np.abs(measured / true - 1) < 0.03).sum()
        total += seen.sum()
    assert right / total > 0.8
    registration = register(imported, sparse, Scale(), CaptureSettings())
    up = registration.world_from_capture[2, :3]
    assert np.degrees(np.arccos(up[2])) < 0.3
    # Most floor points lie on the rug, which is some 12 mm thick.
    assert -0.02 < registration.world_from_capture[2, 3] < 0.005


def test_only_captures_that_hardly_share_anything_are_matched_further():
    """A chain of four with plenty from one to the next, whose ends and a fifth that is alone are poor."""
    found = {(0, 1): 100, (1, 2): 300, (2, 3): 100, (0, 2): 99, (3, 4): 20}
    plain = {pair: np.zeros((count, 2), np.int32) for pair, count in found.items()}
    near = [(i, j) for i in range(5) for j in range(i + 1, 5)]
    assert poorly_matched(plain, near, 5) == [(0, 2), (0, 3), (0, 4), (1, 3), (1, 4), (2, 4), (3, 4)]
    closed = plain | {pair: np.zeros((120, 2), np.int32) for pair in [(0, 3), (0, 4), (3, 4)]}
    assert poorly_matched(closed, near, 5) == []
    assert poorly_matched({}, near, 5) == near
