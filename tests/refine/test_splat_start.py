"""What splats from photographs alone start from: where points come from, what frame and unit."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cameras_file import save_cameras_json
from expected_errors import refused
from progress_recorder import ProgressRecorder
from splat_photographs import ROOM, SETTINGS, captures_in, room_points, sparse_points, write_points, write_transforms

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.poses.colmap_model import save_colmap_model
from r2sego_blender.captures.poses.colmap_points import read_colmap_points
from r2sego_blender.config.presets import with_overrides
from r2sego_blender.core.errors import CaptureError, R2SEgoError, SettingsError
from r2sego_blender.core.images import save_image
from r2sego_blender.evaluation.splat_training import train_on_photographs
from r2sego_blender.refine import splat_start
from r2sego_blender.splats.formats.registry import load_asset
from r2sego_blender.splats.rendering.rasterizer import render


@pytest.fixture
def photographs(tmp_path) -> Path:
    """A folder with photographs, their metric poses and a PLY of points."""
    save_cameras_json(tmp_path / "cameras.json", captures_in(tmp_path))
    write_points(tmp_path / "points.ply")
    return tmp_path


def test_the_asset_is_in_the_frame_and_unit_of_the_poses(tmp_path):
    """Poses of unknown unit: the same room in another unit gives the same asset in that unit."""
    assets = []
    for unit_m in (1.0, 20.0):
        folder = tmp_path / f"unit{unit_m}"
        save_cameras_json(folder / "cameras.json", captures_in(folder, unit_m), metric=False)
        points = write_points(folder / "points.ply", unit_m)
        train_on_photographs(folder, folder / "asset.ply", points=points, settings=SETTINGS)
        assets.append(load_asset(folder / "asset.ply"))
    metres, coarse = assets
    np.testing.assert_allclose(coarse.means * 20.0, metres.means, atol=2e-2)
    np.testing.assert_allclose(coarse.log_scales + np.log(20.0), metres.log_scales, atol=0.1)
    assert np.abs(metres.means - ROOM.asset.means).max() < 0.5


@pytest.mark.parametrize("binary", [False, True])
def test_points_come_from_the_colmap_model(tmp_path, binary):
    captures = captures_in(tmp_path / "images")
    model = tmp_path / "sparse" / "0"
    save_colmap_model(model, captures, sparse_points(len(captures)))
    if binary:
        (model / "points3D.txt").rename(tmp_path / "points3D.txt")
        write_binary(model / "points3D.bin", *room_points())
    points, colours = read_colmap_points(model)
    np.testing.assert_allclose(points, room_points()[0])
    np.testing.assert_array_equal(colours, room_points()[1])
    trained = train_on_photographs(tmp_path, tmp_path / "asset.spz", settings=SETTINGS)
    assert trained.source == "COLMAP model" and trained.gaussians == 1500


def test_points_come_from_the_model_of_which_a_file_is_given(tmp_path):
    captures = captures_in(tmp_path / "images")
    save_colmap_model(tmp_path / "sparse", captures, sparse_points(len(captures)))
    trained = train_on_photographs(
        tmp_path, tmp_path / "asset.ply", poses=tmp_path / "sparse" / "images.txt", settings=SETTINGS
    )
    assert trained.gaussians == 1500


@pytest.mark.parametrize("given", ["", ".", "transforms.json"])
def test_points_come_from_the_ply_that_nerfstudio_names(tmp_path, given):
    write_transforms(tmp_path / "transforms.json", captures_in(tmp_path / "images"), ply_file_path="sparse_pc.ply")
    write_points(tmp_path / "sparse_pc.ply")
    poses = tmp_path / given if given else None
    trained = train_on_photographs(tmp_path, tmp_path / "asset.ply", poses=poses, settings=SETTINGS)
    assert trained.source == "transforms.json" and trained.gaussians == 1500
    assert np.abs(load_asset(tmp_path / "asset.ply").means - ROOM.asset.means).max() < 0.5


def test_points_and_masks_that_are_missing_are_told(tmp_path, monkeypatch):
    captures = captures_in(tmp_path / "images")
    write_transforms(tmp_path / "transforms.json", captures, ply_file_path="sparse_pc.ply")
    data = json.loads((tmp_path / "transforms.json").read_text())
    data["frames"][2]["mask_path"] = "masks/2.png"
    (tmp_path / "transforms.json").write_text(json.dumps(data))
    monkeypatch.setattr(splat_start, "triangulate", lambda images, *_: sparse_points(len(images)))
    progress = ProgressRecorder()
    train_on_photographs(tmp_path, tmp_path / "asset.ply", settings=SETTINGS, progress=progress)
    assert any("sparse_pc.ply" in text and "missing" in text for text in progress.warnings)
    assert any("1 of the 1 masks named" in text and "missing" in text for text in progress.warnings)


def test_what_masks_hide_is_not_trained_on(tmp_path):
    """Half of each photograph is red."""
    captures = captures_in(tmp_path / "images")
    truths = [capture.image() for capture in captures]
    hidden = np.s_[:, :48]
    shown = np.ones((72, 96))
    shown[hidden] = 0.0
    save_image(tmp_path / "mask.png", shown)
    for capture, truth in zip(captures, truths, strict=True):
        image = truth.copy()
        image[hidden] = (1.0, 0.0, 0.0)
        save_image(capture.image_path, image)
    write_transforms(tmp_path / "transforms.json", captures)
    whole = json.loads((tmp_path / "transforms.json").read_text())
    masked = {**whole, "frames": [{**frame, "mask_path": "mask.png"} for frame in whole["frames"]]}
    points = write_points(tmp_path / "points.ply")

    def error(poses: dict) -> float:
        (tmp_path / "transforms.json").write_text(json.dumps(poses))
        progress = ProgressRecorder()
        train_on_photographs(tmp_path, tmp_path / "asset.ply", points=points, settings=SETTINGS, progress=progress)
        assert any("masks of 6 images" in text for _, text in progress.messages) is (poses is masked)
        asset = load_asset(tmp_path / "asset.ply")
        seen = [render(asset, capture.camera).colour for capture in captures]
        return float(np.mean([np.abs(a - b)[hidden].mean() for a, b in zip(seen, truths, strict=True)]))

    assert error(masked) < 0.5 * error(whole)


def test_points_that_were_measured_where_a_mask_hides_are_none(tmp_path, monkeypatch):
    captures = captures_in(tmp_path)
    write_transforms(tmp_path / "transforms.json", captures)
    sparse = sparse_points(len(captures))
    sparse.pixels[::3, 2] = (50.0, 30.0)
    monkeypatch.setattr(splat_start, "triangulate", lambda *_: sparse)
    (tmp_path / "masks").mkdir()
    shown = np.ones(captures[2].camera.shape)
    shown[30, 50] = 0.0
    save_image(tmp_path / "masks" / "photo2.png", shown)
    start = splat_start.prepare(tmp_path, None, None, None, None, SETTINGS)
    assert len(start.points) == 1000


def test_held_out_views_are_said_to_be_scored_whole(photographs):
    (photographs / "masks").mkdir()
    save_image(photographs / "masks" / "photo0.png", np.ones((72, 96)))
    progress = ProgressRecorder()
    points = photographs / "points.ply"
    start = splat_start.prepare(photographs, None, points, None, 3, SETTINGS, progress)
    assert [capture.name for capture in start.held_out] == ["photo0.png", "photo3.png"]
    assert progress.warnings == ["held-out views are scored whole: what their masks hide counts there"]


def test_a_synthetic_scene_of_blender_is_trained_and_scored_on_its_own_split(tmp_path):
    captures = captures_in(tmp_path / "train", count=7)
    write_transforms(tmp_path / "transforms_train.json", captures[::2])
    (tmp_path / "test").mkdir()
    for capture in captures[1::2]:
        capture.image_path.rename(tmp_path / "test" / capture.name)
    held = [Capture(c.name, tmp_path / "test" / c.name, c.camera) for c in captures[1::2]]
    write_transforms(tmp_path / "transforms_test.json", held)
    trained = train_on_photographs(
        tmp_path,
        tmp_path / "asset.ply",
        points=write_points(tmp_path / "points.ply"),
        frozen=tmp_path / "transforms_test.json",
        settings=SETTINGS,
    )
    assert (trained.images, trained.held_out.views) == (4, 3)
    assert trained.held_out.psnr > 15.0


def test_the_size_that_is_trained_on_is_told(photographs):
    told = []
    for side_px in (64, 640):
        progress = ProgressRecorder()
        settings = with_overrides({"captures.max_side_px": side_px, "training.steps_per_round": 1}, SETTINGS)
        train_on_photographs(
            photographs, photographs / "a.ply", points=photographs / "points.ply", settings=settings, progress=progress
        )
        told.append(progress.messages[0][1])
    assert "up to 64 pixels a side, as captures.max_side_px says" in told[0]
    assert "up to 96 pixels a side:" in told[1]


def write_binary(path: Path, points: np.ndarray, colours: np.ndarray) -> None:
    records = [
        struct.pack("<Q3d3BdQ2i", row, *point, *colour, 0.5, 1, 1, row)
        for row, (point, colour) in enumerate(zip(points, colours, strict=True))
    ]
    path.write_bytes(struct.pack("<Q", len(records)) + b"".join(records))


def test_a_model_without_points_has_none(tmp_path):
    save_colmap_model(tmp_path, captures_in(tmp_path / "images"), None)
    assert read_colmap_points(tmp_path) is None
    (tmp_path / "points3D.txt").unlink()
    assert read_colmap_points(tmp_path) is None


@pytest.mark.parametrize("cut", [4, 8 + 30, 8 + 59 * 1000 + 20])
def test_damaged_points_of_a_model_are_named(tmp_path, cut):
    path = tmp_path / "points3D.bin"
    write_binary(path, *room_points())
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(CaptureError, match=r"points3D\.bin"):
        read_colmap_points(tmp_path)


def test_a_count_that_cannot_be_takes_no_memory(tmp_path):
    (tmp_path / "points3D.bin").write_bytes(struct.pack("<Q", 1 << 60) + bytes(100))
    with pytest.raises(CaptureError, match=r"points3D\.bin"):
        read_colmap_points(tmp_path)


def test_points_of_another_place_are_refused(photographs):
    trimesh.PointCloud(room_points()[0] + 1000.0).export(photographs / "far.ply")
    with pytest.raises(CaptureError, match="frame of the poses"):
        train_on_photographs(photographs, photographs / "a.ply", points=photographs / "far.ply", settings=SETTINGS)


@pytest.mark.parametrize(
    ("options", "words"), [({"hold_out": 1}, "2 at least"), ({"hold_out": 2, "frozen": Path("cameras.json")}, "twice")]
)
def test_options_that_do_not_fit_are_refused(photographs, options, words):
    with pytest.raises(SettingsError, match=words):
        train_on_photographs(photographs, photographs / "a.ply", settings=SETTINGS, **options)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"hold_out": 1}, "--hold-out"),
        ({"frozen": Path("gone.json")}, "gone.json"),
        ({"points": Path("gone.ply")}, "gone.ply"),
    ],
)
def test_options_that_cannot_be_are_told_before_poses_are_solved(photographs, monkeypatch, options, told):
    def solving(*_):
        raise AssertionError("photographs were looked at first")

    monkeypatch.setattr(splat_start, "import_captures", solving)
    with refused(R2SEgoError, told):
        train_on_photographs(photographs, photographs / "a.ply", settings=SETTINGS, **options)


def test_views_of_another_frame_than_solved_poses_are_refused(tmp_path):
    captures = captures_in(tmp_path / "photographs")
    save_cameras_json(tmp_path / "held_out.json", captures[:3], frozen=captures[3:])
    with refused(SettingsError, "--frozen", "no poses", cure="--hold-out"):
        splat_start.prepare(
            tmp_path / "photographs", None, None, tmp_path / "held_out.json", None, SETTINGS, ProgressRecorder()
        )


def test_views_that_are_trained_on_are_told(photographs):
    captures = captures_in(photographs)
    save_cameras_json(photographs / "held_out.json", captures[:3], frozen=captures[3:4])
    progress = ProgressRecorder()
    points = photographs / "points.ply"
    splat_start.prepare(photographs, None, points, photographs / "held_out.json", None, SETTINGS, progress)
    (told,) = progress.warnings
    assert told.startswith(captures[3].name)


def test_a_held_out_view_that_is_listed_twice_is_refused(photographs):
    captures = captures_in(photographs)
    write_transforms(photographs / "transforms_test.json", [*captures[:2], captures[0]])
    with pytest.raises(CaptureError, match="2 times"):
        train_on_photographs(
            photographs, photographs / "a.ply", frozen=photographs / "transforms_test.json", settings=SETTINGS
        )


def test_too_few_images_to_train_on_are_said(tmp_path):
    save_cameras_json(tmp_path / "cameras.json", captures_in(tmp_path, count=3))
    with pytest.raises(CaptureError, match="1 image is left"):
        train_on_photographs(tmp_path, tmp_path / "a.ply", hold_out=2, settings=SETTINGS)
