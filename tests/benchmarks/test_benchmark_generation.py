"""The benchmark of the generator says everything it promises, and its truth only scores."""

import json
import shutil

import numpy as np
import pytest
import trimesh

from r2sego_blender.benchmarks.figures import write_figures
from r2sego_blender.benchmarks.generation import bench_generation, lines
from r2sego_blender.cameras import Camera, look_at
from r2sego_blender.captures.cameras_json import save_cameras_json
from r2sego_blender.captures.capture import Capture
from r2sego_blender.creation import create_scene
from r2sego_blender.errors import SceneError
from r2sego_blender.evaluation.error_causes import CAUSES
from r2sego_blender.geometry.rasterizer import MeshRasterizer
from r2sego_blender.images import save_image
from r2sego_blender.progress import SILENT
from r2sego_blender.scene import Scene
from r2sego_blender.steps import Steps

TINY = {
    "stereo.max_side_px": 160, "proxy.voxel_m": 0.05, "proxy.truncation_m": 0.12, "generation.clip_frames": 4,
}  # fmt: skip


def paint(points: np.ndarray) -> np.ndarray:
    """A smooth colour that never repeats, for points (..., 3)."""
    waves = np.random.default_rng(11).normal(size=(24, 3, 3)) * 14.0
    value = sum(np.sin(points @ wave.T + phase) for phase, wave in enumerate(waves))
    return np.clip(0.5 + 0.06 * value, 0, 1).astype(np.float32)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A painted room of 4 m by 3 m with a box in it: four captures, two frozen views, 160x120."""
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
    rasterizer = MeshRasterizer(mesh.vertices, mesh.faces)
    places = [(x, -1.2, 1.5, 0.3 * x) for x in (-0.9, -0.3, 0.3, 0.9)]
    places += [(-0.5, -0.9, 1.3, 0.0), (0.6, -0.8, 1.2, 0.4)]
    captures = []
    for index, (x, y, z, aim) in enumerate(places):
        camera = Camera(160, 120, 105.0, 105.0, 80.0, 60.0, look_at((x, y, z), (aim, 1.0, 0.5)))
        buffers = rasterizer.render(camera)
        file = folder / f"view{index}.png"
        save_image(file, paint(camera.unproject(buffers.depth)))
        ids = buffers.of_face(instances, missing=-1).astype(np.int16)
        np.savez(folder / f"depth/view{index}.npz", z=buffers.depth, ids=ids)
        captures.append(Capture(file.name, file, camera))
    save_cameras_json(folder / "cameras.json", captures[:4], frozen=captures[4:])
    return folder


@pytest.fixture(scope="module")
def bundle(scene, tmp_path_factory):
    """A bundle of the scene with its first proxy."""
    path = tmp_path_factory.mktemp("bundle") / "scene.r2s"
    create_scene(path, scene, scene / "cameras.json")
    made = Scene.open(path).declare(overrides=TINY)
    step = Steps(made, made.declaration.settings, SILENT)
    captures, asset = step.register_inputs()
    observed, priors = step.observed_and_prior_geometry(captures)
    step.geometry_proxy(0, captures, observed, step.align_priors(observed, priors), asset)
    return path


@pytest.fixture(scope="module")
def figures(scene, bundle):
    return bench_generation(scene, bundle, clips=1)


@pytest.mark.slow
def test_all_figures_are_there(figures, tmp_path):
    for arm in (figures["estimated"], figures["true_geometry"]):
        assert set(arm["causes"]) == set(CAUSES)
        assert sum(one["error"] for one in arm["causes"].values()) == pytest.approx(1.0)
        assert arm["view_s"] > 0 and len(arm["views"]) == figures["frozen"] == 2
        assert -1.0 <= arm["confidence_correlation"] <= 1.0
    assert figures["estimated"]["clips"][0]["mean_difference"] < 0.05
    write_figures(tmp_path / "figures.json", figures)
    assert json.loads((tmp_path / "figures.json").read_text()) == figures
    text = "\n".join(lines(figures))
    assert "true geometry" in text and "along the flow" in text and "never seen" in text


@pytest.mark.slow
def test_true_geometry_is_better_than_estimated(figures):
    assert figures["true_geometry"]["psnr"] > figures["estimated"]["psnr"] > 18.0
    assert figures["true_geometry"]["causes"]["wrong_depth"]["pixels"] < 0.001


@pytest.mark.slow
def test_the_truth_scores_and_does_nothing_else(scene, bundle, figures, tmp_path):
    """With a false surface the true arm and the causes change; the estimated images do not."""
    shutil.copytree(scene, tmp_path, dirs_exist_ok=True)
    surface = dict(np.load(tmp_path / "room.npz"))
    np.savez(tmp_path / "room.npz", **(surface | {"V": 1.3 * surface["V"]}))
    falsely = bench_generation(tmp_path, bundle, clips=0)
    assert falsely["estimated"]["views"] == figures["estimated"]["views"]
    assert falsely["true_geometry"]["psnr"] < figures["true_geometry"]["psnr"] - 3.0
    assert falsely["estimated"]["causes"]["wrong_depth"]["pixels"] > 0.5
    assert figures["estimated"]["causes"]["wrong_depth"]["pixels"] < 0.3


def test_a_bundle_without_proxy_is_refused(scene, tmp_path):
    with pytest.raises(SceneError, match="no proxy"):
        bench_generation(scene, tmp_path)
