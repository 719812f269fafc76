"""A model estimates a scene's depth: what it says stands in the bundle under its name, or nothing has changed."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from bundles import new_bundle
from click.testing import CliRunner
from stand_in_models import NORMAL, OFFSET, write_stand_ins

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.captures.store import CAPTURES, save_captures
from r2sego_blender.commands.cli import main
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import MachineError, SettingsError
from r2sego_blender.core.images import save_image
from r2sego_blender.editing.recorded_depth import describe_recorded, estimate_depth, remove_depth
from r2sego_blender.geometry.estimators.estimated_depth import ESTIMATES
from r2sego_blender.workers.learned_backends import LEARNED_BACKENDS

BACKEND = LEARNED_BACKENDS["mapanything"]


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    captures = []
    for index in range(3):
        path = tmp_path / f"p{index}.png"
        save_image(path, np.full((60, 80, 3), 0.5, np.float32))
        camera = Camera(80, 60, 70.0, 70.0, 40.0, 30.0, look_at((0.4 * index, 0.1, 1.4), (0, 3.0, 1.0)))
        captures.append(Capture(path.name, path, camera))
    nothing = SparsePoints.none(len(captures))

    def fill(folder: Path) -> None:
        (folder / "captures").mkdir()
        save_captures(folder / "captures", captures, nothing)

    return new_bundle(tmp_path / "a.r2s", fill=fill)


def test_a_models_maps_stand_in_the_bundle_under_its_name_until_they_are_removed(scene, tmp_path, monkeypatch):
    before = content_digest(scene.path)
    monkeypatch.setenv("PYTHONPATH", str(write_stand_ins(tmp_path / "environment")))
    monkeypatch.setenv(BACKEND.variable, sys.executable)
    done = CliRunner().invoke(main, ["estimate-depth", str(scene.path), "--backend", BACKEND.name])
    assert done.exit_code == 0, done.output
    made = Scene.open(scene.path)
    assert made.declaration.backends["depth_estimator"] == "MapAnything 1.1"
    assert describe_recorded(made)["recorded"] == 3
    captures, maps = made.read(CAPTURES), made.read(ESTIMATES)
    for index, one in enumerate(captures):
        estimate = maps.found(captures, index)
        rays = one.camera.rays() @ one.camera.world_from_camera[:3, :3].T
        true = (OFFSET - np.array(NORMAL) @ one.camera.centre) / (rays @ NORMAL)
        known = estimate.valid
        assert known.mean() > 0.97
        np.testing.assert_allclose(estimate.depth[known], true[known], rtol=1e-4)
    remove_depth(made)
    assert content_digest(scene.path) == before


def test_a_model_that_is_not_set_up_changes_nothing(scene, tmp_path, monkeypatch):
    monkeypatch.setenv("R2SEGO_CONFIG", str(tmp_path / "nothing"))
    monkeypatch.delenv(BACKEND.variable, raising=False)
    before = content_digest(scene.path)
    with pytest.raises(MachineError):
        estimate_depth(scene, BACKEND.name)
    for name in ("sam3", "recorded", "nothing"):
        with pytest.raises(SettingsError):
            estimate_depth(scene, name)
    assert content_digest(scene.path) == before


def test_one_way_to_maps_at_once(scene, tmp_path):
    for arguments in (["--backend", BACKEND.name, "--remove"], ["--backend", BACKEND.name, "--inverse"]):
        assert CliRunner().invoke(main, ["estimate-depth", str(scene.path), *arguments]).exit_code == 1
