"""The demo room's ground truth: it is of the shipped pictures, and as the benchmarks read it."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from r2sego_blender.core.images import load_image
from r2sego_blender.evaluation.ground_truth import GroundTruth, load_ground_truth
from tools.benchmarks.truth.true_objects import true_objects

PROGRAM = Path(__file__).resolve().parents[1] / "demo" / "make_truth.py"


def make_truth(folder: Path) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, str(PROGRAM), str(folder)], capture_output=True, text=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("demo") / "truth"
    made = make_truth(folder)
    assert made.returncode == 0, made.stderr
    return folder


@pytest.fixture(scope="module")
def truth(folder) -> GroundTruth:
    return load_ground_truth(folder)


def colour_difference(truth: GroundTruth, images: list[np.ndarray], here: int, there: int, scale: float):
    """Median over what both captures see of how much the colours of the same points differ."""
    view, other = truth.views[here], truth.views[there]
    points = view.camera.unproject(view.depth * scale)
    pixels, depth = other.camera.project(points.reshape(-1, 3))
    column, row = np.where(other.camera.sees(pixels, depth)[:, None], pixels, 0).astype(int).T
    same = np.abs(other.depth[row, column] / np.maximum(depth, 1e-6) - 1.0) < 0.005 + abs(scale - 1.0)
    same &= other.camera.sees(pixels, depth)
    assert same.mean() > 0.1
    return np.median(np.abs(images[here].reshape(-1, 3)[same] - images[there][row, column][same]))


def test_neighbouring_pictures_agree_on_the_true_surface_and_nowhere_else(folder, truth):
    images = [load_image(next((folder / "captures").glob(f"{view.name}.*"))) for view in truth.views]
    for here in range(len(images) - 1):
        true = colour_difference(truth, images, here, here + 1, 1.0)
        assert true < 0.015
        assert true < 0.8 * min(colour_difference(truth, images, here, here + 1, s) for s in (0.97, 1.03))


def test_rays_end_on_the_room_that_was_built(truth):
    for view in truth.views:
        assert (view.depth > 0.0).all()  # the room is closed
        points = view.camera.unproject(view.depth)
        rug = points[view.ids == truth.names.index("rug")]
        assert rug[:, 2].min() > 0.0 and rug[:, 2].max() < 0.02
        shell = points[view.ids == truth.names.index("shell")]
        assert np.mean(np.abs(shell[:, 2]) < 1e-4) > 0.1  # the floor is at z = 0


def test_the_furniture_on_the_floor_is_told_apart(truth):
    names = {one.name for one in true_objects(truth, np.random.default_rng(0))}
    assert names >= {"sofa", "low table", "mustard chair", "navy chair", "bookshelf", "pouf", "plant"}
    assert not names & {"shell", "rug", "curtain", "picture hills"}


def test_a_folder_that_is_there_is_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    refused = make_truth(tmp_path)
    assert refused.returncode != 0 and "is there already" in refused.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
