"""The benchmark of geometry says everything it promises, and its truth only scores."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from r2sego_blender.benchmarks.figures import write_figures
from r2sego_blender.benchmarks.geometry import bench_geometry, lines
from r2sego_blender.cameras import Camera, look_at
from r2sego_blender.captures.cameras_json import save_cameras_json
from r2sego_blender.captures.capture import Capture
from r2sego_blender.errors import CaptureError, EvaluationError
from r2sego_blender.geometry.rasterizer import MeshRasterizer
from r2sego_blender.images import save_image

ROOT = Path(__file__).parents[2]
SECONDS = (
    "creation", "stereo", "initial_asset", "observed", "planes", "completion", "backdrop", "priors",
    "composition", "refresh", "proxy",
)  # fmt: skip
SHARES = (
    "stereo_coverage", "stereo_accuracy", "stereo_view1_coverage", "stereo_view1_accuracy",
    "noisy_stereo_coverage", "noisy_stereo_accuracy", "noisy_stereo_view2_coverage",
    "proxy_fscore", "proxy_precision", "proxy_recall",
)  # fmt: skip


def paint(points: np.ndarray) -> np.ndarray:
    """A smooth colour that never repeats, for points (..., 3)."""
    waves = np.random.default_rng(11).normal(size=(24, 3, 3)) * 14.0
    value = sum(np.sin(points @ wave.T + phase) for phase, wave in enumerate(waves))
    return np.clip(0.5 + 0.06 * value, 0, 1)


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    """A painted room of 4 m by 3 m with a box in it, seen by four captures of 160x120."""
    folder = tmp_path_factory.mktemp("scene")
    shell = trimesh.creation.box((4.0, 3.0, 2.4))
    shell.apply_translation((0, 0, 1.2))
    shell.invert()
    box = trimesh.creation.box((1.0, 0.6, 0.7))
    box.apply_translation((0.9, 0.8, 0.35))
    mesh = trimesh.util.concatenate([shell, box])
    instances = np.repeat([0, 1], [len(shell.faces), len(box.faces)])
    np.savez(folder / "room.npz", V=mesh.vertices, F=mesh.faces, I=instances, names=np.array(["room", "box"]))
    (folder / "depth").mkdir()
    captures = []
    for index, x in enumerate((-0.9, -0.3, 0.3, 0.9)):
        camera = Camera(160, 120, 105.0, 105.0, 80.0, 60.0, look_at((x, -1.2, 1.5), (0.3 * x, 1.0, 0.5)))
        buffers = MeshRasterizer(mesh.vertices, mesh.faces).render(camera)
        file = folder / f"view{index}.png"
        save_image(file, paint(camera.unproject(buffers.depth)).astype(np.float32))
        ids = buffers.of_face(instances, missing=-1).astype(np.int16)
        np.savez(folder / f"depth/view{index}.npz", z=buffers.depth, ids=ids)
        captures.append(Capture(file.name, file, camera))
    save_cameras_json(folder / "cameras.json", captures)
    return folder


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
    np.savez(tmp_path / "room.npz", **(surface | {"V": surface["V"] + (0.0, 0.0, 20.0)}))
    falsely = bench_geometry(tmp_path, seed=3, noise=False)
    assert falsely["stereo_coverage"] == figures["stereo_coverage"]
    assert falsely["stereo_accuracy"] < 0.01 and falsely["proxy_precision"] == 0.0
    assert not any(name.startswith("noisy") for name in falsely)


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
