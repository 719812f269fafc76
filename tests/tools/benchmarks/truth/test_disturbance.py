"""Disturbed captures are disturbed by what is promised, and by nothing else."""

import json
from pathlib import Path

import numpy as np
import pytest
from cameras_file import save_cameras_json

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.importing import import_captures
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import Camera, look_at, rotation_angle_rad
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import load_image, save_image
from tools.benchmarks.truth.disturbance import GAIN, NOISE_SIGMA, disturbed_captures, disturbed_pose

GREYS = (0.3, 0.5, 0.6)


@pytest.fixture
def scene(tmp_path) -> Path:
    captures = []
    (tmp_path / "photographs").mkdir()
    for index, grey in enumerate(GREYS):
        file = tmp_path / f"photographs/{index}.png"
        save_image(file, np.full((90, 120, 3), grey, np.float32))
        camera = Camera(120, 90, 100.0, 101.0, 60.0, 44.0, look_at((index, -2.0, 1.5), (0.0, 1.0, 1.0)))
        captures.append(Capture(file.name, file, camera))
    save_cameras_json(tmp_path / "cameras.json", captures[:3], frozen=captures[:1], metric=False)
    return tmp_path


def captures_of(folder: Path):
    return import_captures(folder, folder / "cameras.json", CaptureSettings())


def disturbed(scene: Path, folder: Path, seed: int = 0) -> Path:
    folder.mkdir()
    disturbed_captures(scene, folder, np.random.default_rng(seed))
    return folder


def test_images_get_one_gain_each_and_noise(scene, tmp_path):
    after = captures_of(disturbed(scene, tmp_path / "d"))
    gains = []
    for grey, capture in zip(GREYS, after.captures, strict=True):
        image = load_image(capture.image_path)
        gains.append(image.mean() / grey)
        assert image.std() == pytest.approx(NOISE_SIGMA, rel=0.03)
    assert len({round(gain, 4) for gain in gains}) == 3
    assert all(1 - GAIN - 1e-3 < gain < 1 + GAIN + 1e-3 for gain in gains)


def test_cameras_are_moved_and_turned_by_the_magnitudes(scene, tmp_path):
    before, after = captures_of(scene), captures_of(disturbed(scene, tmp_path / "d"))
    assert after.metric is before.metric is False
    moves = []
    for one, other in zip(before.captures, after.captures, strict=True):
        moves.append(other.camera.centre - one.camera.centre)
        assert np.linalg.norm(moves[-1]) == pytest.approx(0.01)
        turned = rotation_angle_rad(one.camera.world_from_camera, other.camera.world_from_camera)
        assert np.degrees(turned) == pytest.approx(0.3, rel=1e-4)
        np.testing.assert_array_equal(one.camera.matrix, other.camera.matrix)
    assert not np.allclose(moves[0], moves[1])


def test_directions_favour_none():
    generator = np.random.default_rng(1)
    moves = np.array([disturbed_pose(np.eye(4), generator)[:3, 3] for _ in range(4000)]) / 0.01
    np.testing.assert_allclose(moves.mean(axis=0), 0.0, atol=0.04)
    np.testing.assert_allclose(moves.T @ moves / len(moves), np.eye(3) / 3, atol=0.02)


def test_a_seed_gives_the_same_bytes_and_another_others(scene, tmp_path):
    first, same, other = (disturbed(scene, tmp_path / n, s) for n, s in (("a", 3), ("b", 3), ("c", 4)))
    names = sorted(file.name for file in first.iterdir())
    assert names == ["0000.png", "0001.png", "0002.png", "cameras.json"]
    for name in names:
        assert (first / name).read_bytes() == (same / name).read_bytes()
        assert (first / name).read_bytes() != (other / name).read_bytes()
    assert "frozen" not in json.loads((first / "cameras.json").read_text())


def test_photographs_that_are_missing_are_named(scene, tmp_path):
    (scene / "photographs/1.png").unlink()
    with pytest.raises(CaptureError, match=r"1\.png"):
        disturbed(scene, tmp_path / "d")
