"""The baselines of a small bundle: trained side by side, and each as if it were alone."""

from dataclasses import replace

import numpy as np
import pytest
from progress_recorder import ProgressRecorder
from small_bundle import bundle, splats

from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.config.presets import SPARSE_STABLE_SH3, UNBOUNDED, VANILLA_3DGS
from r2sego_blender.core import threads
from r2sego_blender.evaluation.arms import ARMS, GAUSSGYM, SAME_POINTS, VANILLA
from r2sego_blender.evaluation.trained_arms import train_arms
from r2sego_blender.geometry.stereo.observed_geometry import OBSERVED, ObservedGeometry
from r2sego_blender.refine.visual_asset import vanilla_asset
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.ply import load_ply, save_ply
from r2sego_blender.splats.training.observations import Observation

BASELINES = (VANILLA, GAUSSGYM, SAME_POINTS)
STEPS = 12


@pytest.fixture
def scene(tmp_path):
    """A bundle whose points are observed."""
    made = bundle(tmp_path, [splats(0.55), splats(0.62)], SplatAsset.empty())
    points = splats(0.7).means.astype(np.float32)
    seen = np.ones((len(points), 2), bool)
    upwards, colours = np.tile(np.float32([0, 0, 1]), (len(points), 1)), np.full((len(points), 3), 0.7, np.float32)
    observed = ObservedGeometry(points, upwards, colours, seen, np.ones(len(points), np.float32))
    observed.save(made.path / OBSERVED.name)
    return made.declare(overrides={"rounds": 2, "training.steps_per_round": STEPS // 2})


def _alone(scene, arm, path):
    """The file of what one thread trains with nothing beside it."""
    h = scene.declaration.settings
    its = {VANILLA: VANILLA_3DGS, GAUSSGYM: SPARSE_STABLE_SH3, SAME_POINTS: UNBOUNDED}[arm]
    observed, rng = scene.read(OBSERVED), np.random.default_rng([h.seed, 1])
    seen = [Observation(capture.camera, capture.image()) for capture in scene.read(CAPTURES)]
    settings = replace(h.training, **its)
    save_ply(path, vanilla_asset(observed.points, observed.colours, seen, STEPS, settings, rng))
    return path.read_bytes()


@pytest.mark.parametrize("callers", [1, 2, 3])
def test_each_is_as_if_it_were_trained_alone(scene, tmp_path, monkeypatch, with_threads, callers):
    monkeypatch.setattr(threads, "kernel_callers", lambda: callers)
    recorder = ProgressRecorder()
    with scene.locked():
        train_arms(scene, recorder, BASELINES)
    expected = {arm: with_threads(1, lambda arm=arm: _alone(scene, arm, tmp_path / "one.ply")) for arm in BASELINES}
    assert {arm: (scene.path / ARMS[arm].asset).read_bytes() for arm in BASELINES} == expected
    assert expected[VANILLA] != expected[SAME_POINTS]
    assert [(task.done, task.total) for task in recorder.tasks] == [(3 * STEPS, 3 * STEPS)]
    assert all(record["seconds"] > 0.0 for record in scene.journal() if "seconds" in record)


def test_what_is_there_is_passed_over_and_what_lacks_is_trained(scene):
    with scene.locked():
        train_arms(scene, arms=(SAME_POINTS,))
        recorder, before = ProgressRecorder(), (scene.path / ARMS[SAME_POINTS].asset).stat()
        train_arms(scene, recorder, (SAME_POINTS, GAUSSGYM))
        assert [task.total for task in recorder.tasks] == [STEPS]
        assert ARMS[GAUSSGYM].label in recorder.tasks[0].title
        assert (scene.path / ARMS[SAME_POINTS].asset).stat().st_mtime_ns == before.st_mtime_ns
        train_arms(scene, recorder, BASELINES[1:])
        assert len(recorder.tasks) == 1


def test_the_budget_bounds_none_of_them(scene):
    """It is this project's own: vanilla 3DGS has none, and the points are those that were observed."""
    observed = scene.read(OBSERVED)
    fewer = scene.declare(overrides={**scene.declaration.overrides, "training.max_gaussians": 1000})
    assert len(observed.points) > fewer.declaration.settings.training.max_gaussians
    with fewer.locked():
        train_arms(fewer, arms=BASELINES)
    for arm in (GAUSSGYM, SAME_POINTS):
        assert len(load_ply(fewer.path / ARMS[arm].asset)) == len(observed.points)
