"""The benchmark of geometry says everything it promises, and its truth only scores."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bundles import new_bundle
from painted_room import write_painted_room

from r2sego_blender.bundle.layout import DEPTH, capture_files
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.store import save_captures
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import CaptureError, EvaluationError
from r2sego_blender.core.images import save_image
from r2sego_blender.evaluation.ground_truth import GroundTruth, TrueView
from r2sego_blender.geometry.stereo.stereo import DepthMap
from tools.benchmarks.figures import write_figures
from tools.benchmarks.geometry import _stereo_scores, bench_geometry, lines

ROOT = Path(__file__).parents[3]
SECONDS = (
    "creation",
    "stereo",
    "initial_asset",
    "observed",
    "planes",
    "completion",
    "backdrop",
    "priors",
    "composition",
    "refresh",
    "proxy",
)
SHARES = (
    "stereo_coverage",
    "stereo_accuracy",
    "stereo_view1_coverage",
    "stereo_view1_accuracy",
    "noisy_stereo_coverage",
    "noisy_stereo_accuracy",
    "noisy_stereo_view2_coverage",
    "proxy_fscore",
    "proxy_precision",
    "proxy_recall",
)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return write_painted_room(tmp_path_factory.mktemp("scene"), frozen=False)


@pytest.fixture(scope="module")
def figures(scene) -> dict:
    return bench_geometry(scene, seed=3)


@pytest.mark.slow
def test_all_figures_are_there(figures, tmp_path):
    for part in SECONDS:
        assert figures[f"{part}_wall_s"] > 0 and figures[f"{part}_cpu_s"] >= 0
    assert all(0 <= figures[name] <= 1 for name in SHARES)
    assert figures["noisy_stereo_wall_s"] > 0 and figures["peak_rss_mb"] > 0
    assert (figures["captures"], figures["seed"]) == (4, 3)
    assert figures["proxy_wall_s"] == pytest.approx(
        sum(figures[f"{part}_wall_s"] for part in SECONDS if part not in ("proxy", "refresh")), abs=0.01
    )
    assert not any(isinstance(value, dict | list) for value in figures.values())
    write_figures(tmp_path / "figures.json", figures)
    assert json.loads((tmp_path / "figures.json").read_text()) == figures
    text = "\n".join(lines(figures))
    assert "captures to proxy" in text and "F-score" in text and "noisy stereo" in text


@pytest.mark.slow
def test_a_painted_room_is_measured_well_and_noise_costs_little(figures):
    assert figures["stereo_coverage"] > 0.6 and figures["stereo_accuracy"] > 0.95
    assert figures["proxy_median_error_m"] < 0.02
    assert figures["proxy_precision"] > 0.7  # the walls behind the cameras are guessed
    assert figures["noisy_stereo_coverage"] > 0.4 and figures["noisy_stereo_accuracy"] > 0.8
    assert figures["noisy_stereo_coverage"] != figures["stereo_coverage"]


@pytest.mark.slow
def test_the_truth_scores_and_does_nothing_else(scene, figures, tmp_path):
    """With a false truth the scores are others; what was made is the same."""
    for source in scene.rglob("*"):
        if source.is_file():
            target = tmp_path / source.relative_to(scene)
            target.parent.mkdir(exist_ok=True)
            target.write_bytes(source.read_bytes())
    for file in (tmp_path / "depth").iterdir():
        truth = dict(np.load(file))
        np.savez(file, **(truth | {"z": 1.5 * truth["z"]}))
    surface = dict(np.load(tmp_path / "room.npz"))
    np.savez(tmp_path / "room.npz", **(surface | {"V": surface["V"] + 20.0}))
    falsely = bench_geometry(tmp_path, seed=3, noise=False)
    assert falsely["stereo_coverage"] == figures["stereo_coverage"]
    assert falsely["stereo_accuracy"] < 0.01 and falsely["proxy_precision"] == 0.0
    assert not any(name.startswith("noisy") for name in falsely)


def test_depth_of_a_rig_is_scored_too(tmp_path):
    """Its captures are named by paths, and their files are not."""
    camera = Camera(32, 24, 30.0, 30.0, 16.0, 12.0, look_at((0.0, -2.0, 1.2), (0.0, 0.5, 0.8)))
    for k in range(2):
        save_image(tmp_path / f"{k}.png", np.full((24, 32, 3), 0.5, np.float32))
    names = ["cam0/0000.png", "cam1/0000.png"]
    captures = [Capture(name, tmp_path / f"{k}.png", camera) for k, name in enumerate(names)]
    true = [
        TrueView(name, camera, np.full(camera.shape, 2.0 + k, np.float32), np.zeros(camera.shape, int))
        for k, name in enumerate(names)
    ]
    nothing = np.zeros((0, 3))
    truth = GroundTruth(tuple(true), nothing, nothing, nothing[:, 0], ())

    def fill(folder):
        save_captures(folder / "captures", captures)
        (folder / DEPTH).mkdir(parents=True)
        for view, file in zip(true, capture_files(names), strict=True):
            found = DepthMap(
                view.depth,
                np.zeros((*camera.shape, 3), np.float32),
                np.zeros(camera.shape, np.float32),
                np.full(camera.shape, 2, np.uint8),
                camera,
            )
            found.save(folder / DEPTH / file)

    scores = _stereo_scores(new_bundle(tmp_path / "rig.r2s", fill), truth)
    for name in ("stereo", *(f"stereo_{name}" for name in names)):
        assert scores[f"{name}_coverage"] == scores[f"{name}_accuracy"] == 1.0


def test_folders_without_truth_are_refused_before_any_work(scene, tmp_path):
    with pytest.raises(CaptureError, match=r"cameras\.json"):
        bench_geometry(tmp_path)
    for name in ("cameras.json", "view0.png", "view1.png", "view2.png", "view3.png"):
        (tmp_path / name).write_bytes((scene / name).read_bytes())
    with pytest.raises(EvaluationError, match=r"room\.npz"):
        bench_geometry(tmp_path)
    command = [sys.executable, "-m", "r2sego_blender", "bench", "geometry", "--scene", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert "room.npz" in done.stderr.strip().splitlines()[-1]
