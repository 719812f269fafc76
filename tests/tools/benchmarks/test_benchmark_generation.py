"""The benchmark of the generator says everything it promises, and its truth only scores."""

import json
import shutil

import numpy as np
import pytest
from painted_room import write_painted_room

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core.errors import SceneError
from r2sego_blender.evaluation.error_causes import CAUSES
from r2sego_blender.geometry.proxy.proxy import PROXY
from r2sego_blender.pipeline import refine
from r2sego_blender.refine.creation import create_scene
from tools.benchmarks.figures import write_figures
from tools.benchmarks.generation import bench_generation, lines

TINY = {"stereo.max_side_px": 160, "proxy.voxel_m": 0.05, "proxy.truncation_m": 0.12, "generation.clip_frames": 4}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return write_painted_room(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def bundle(scene, tmp_path_factory):
    """A bundle of the scene with its first proxy."""
    path = tmp_path_factory.mktemp("bundle") / "scene.r2s"
    create_scene(path, scene, scene / "cameras.json")
    made = Scene.open(path).declare(overrides=TINY)
    refine(made, until=PROXY.of_round(0).name)
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
