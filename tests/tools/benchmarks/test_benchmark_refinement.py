"""The benchmark of the loop says everything it promises, and its truth and frozen views only score."""

import json
import shutil

import numpy as np
import pytest
import trimesh
from painted_room import write_painted_room

from r2sego_blender.bundle.figures import BASELINES
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import EvaluationError, SceneError, SettingsError
from r2sego_blender.core.images import save_image
from r2sego_blender.evaluation.arms import ARMS, DEFAULT_ARMS
from tools.benchmarks.figures import write_figures
from tools.benchmarks.refinement import bench_refinement, lines

TINY = {
    "rounds": 2,
    "stereo.max_side_px": 120,
    "stereo.geometric_rounds": 1,
    "proxy.voxel_m": 0.06,
    "proxy.truncation_m": 0.15,
    "collision.tolerance_m": 0.1,
    "collision.carrying_tolerance_m": 0.1,
    "collision.min_cell_m": 0.2,
    "rollouts.successes": 2,
    "selection.candidates": "flight",
    "selection.target_views": 2,
    "selection.scoring_scale": 0.25,
    "generation.clip_frames": 2,
    "generation.max_replacements": 1,
    "training.steps_per_round": 30,
    "training.max_gaussians": 6000,
    "training.sh_degree": 0,
}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return write_painted_room(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def other_scene(tmp_path_factory):
    """Another scene's file: a sphere and a pole."""
    file = tmp_path_factory.mktemp("other") / "other.glb"
    parts = {"ball": trimesh.creation.icosphere(radius=0.4), "pole": trimesh.creation.cylinder(0.05, 1.5)}
    trimesh.Scene(parts).export(file)
    return file


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Where the bundle is made and stays."""
    return tmp_path_factory.mktemp("kept") / "scene.r2s"


@pytest.fixture(scope="module")
def figures(scene, kept):
    return bench_refinement(scene, kept, preset="preview", overrides=TINY)


@pytest.mark.slow
def test_all_figures_are_there(figures, tmp_path):
    assert (figures["captures"], figures["frozen"], figures["preset"]) == (4, 2, "preview")
    seconds = figures["seconds"]
    assert {"creation", "geometry/depth", "rounds/1/views", "report/vanilla_3dgs.ply"} <= seconds.keys()
    rest = sum(value for part, value in seconds.items() if not part.startswith("report/"))
    assert 0.0 < figures["refinement_s"] == pytest.approx(rest, abs=1e-3) and figures["made_before"] == []
    for one in figures["views"]:
        assert one["kept"] + one["rejected"] >= 2 and len(one["reasons"]) == one["rejected"]
    assert [one["round"] for one in figures["rounds"]] == [0, 1]
    first, second = (one["psnr"] for one in figures["rounds"])
    assert figures["rounds_fall"] == (first - second >= 0.005)
    assert figures["refined"]["psnr"] == second
    baseline = max(figures[arm]["psnr"] for arm in BASELINES if arm in figures)
    assert figures[figures["strongest_baseline"]]["psnr"] == baseline
    assert figures["gain"] == pytest.approx(second - baseline, abs=2e-4)
    assert figures["objects"] == {} and figures["causes"]["shares"]
    write_figures(tmp_path / "figures.json", figures)
    assert json.loads((tmp_path / "figures.json").read_text()) == figures
    text = "\n".join(lines(figures))
    for told in ("refinement", "gain over", "round 1", *(ARMS[arm].label for arm in DEFAULT_ARMS)):
        assert told in text


@pytest.mark.slow
def test_frozen_views_score_and_do_nothing_else(scene, kept, figures, tmp_path):
    """With other frozen photographs nothing is made again, and the scores are others."""
    shutil.copytree(scene, tmp_path / "scene")
    for name in ("view4.png", "view5.png"):
        save_image(tmp_path / "scene" / name, np.full((120, 160, 3), 0.5, np.float32))
    bundle = shutil.copytree(kept, tmp_path / "scene.r2s")
    falsely = bench_refinement(tmp_path / "scene", bundle)
    assert set(falsely["made_before"]) == set(falsely["seconds"]) == set(figures["seconds"]) - {"creation"}
    assert falsely["refined"]["psnr"] != figures["refined"]["psnr"]
    assert content_digest(bundle / "asset.ply") == content_digest(kept / "asset.ply")


@pytest.mark.slow
def test_a_library_gives_the_true_objects_shapes(scene, other_scene, kept, figures, tmp_path):
    bundle = shutil.copytree(kept, tmp_path / "scene.r2s")
    fewer = {"rounds": 1}
    with_shapes = bench_refinement(scene, bundle, other_scene, overrides=fewer)
    assert list(with_shapes["objects"]) == ["box"]
    assert "geometry/depth" in with_shapes["made_before"]
    assert not {"geometry/priors", "rounds/0/proxy"} & set(with_shapes["made_before"])
    assert not any(part.startswith("rounds/1/") for part in with_shapes["seconds"])
    ran = len(Scene.open(bundle).journal())
    again = bench_refinement(scene, bundle, other_scene)
    assert len(Scene.open(bundle).journal()) == ran and again["refined"] == with_shapes["refined"]


@pytest.mark.slow
def test_a_bundle_of_other_captures_is_refused(scene, kept, figures, tmp_path):
    moved = shutil.copytree(scene, tmp_path / "scene")
    cameras = json.loads((moved / "cameras.json").read_text())
    cameras["captures"][0]["world_from_camera"][0][3] += 1.0
    (moved / "cameras.json").write_text(json.dumps(cameras))
    ran = len(Scene.open(kept).journal())
    with pytest.raises(SceneError, match="not of the captures"):
        bench_refinement(moved, kept)
    assert len(Scene.open(kept).journal()) == ran


def test_what_is_missing_is_said_before_any_work(scene, other_scene, tmp_path):
    bare = tmp_path / "bare"
    shutil.copytree(scene, bare, ignore=shutil.ignore_patterns("depth"))
    with pytest.raises(EvaluationError, match="no such file"):
        bench_refinement(bare, tmp_path / "new.r2s", other_scene)
    with pytest.raises(SettingsError, match="no setting 'roundss'"):
        bench_refinement(scene, tmp_path / "new.r2s", overrides={"roundss": 1})
    assert not (tmp_path / "new.r2s").exists()
