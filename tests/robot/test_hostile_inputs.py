"""Robots, motions, scopes and rollouts of strangers: one error of the family in moments, or clean values."""

from __future__ import annotations

import math
import shutil
import time
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_rollouts import ROBOT
from fake_rollouts import rollouts as made_up

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core.errors import R2SEgoError
from r2sego_blender.robot.controllers.policy_layout import PolicyLayout
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.model.robot_file import robot_digest
from r2sego_blender.robot.motion.recorded_motion import read_recording
from r2sego_blender.robot.rollouts.rollout import load_rollouts, save_rollouts
from r2sego_blender.robot.scope.scope import BehaviourScope

HOSTILE = Path(__file__).resolve().parents[3] / "shared" / "failing" / "hostile"
MOUNT = ["torso_link", [0.05, 0.0, 0.4], [0.0, 0.8, 0.0], {"hfov_deg": 69.0}]


def robot(file: Path, folder: Path) -> Any:
    model = RobotModel.load(file, MOUNT)
    return [model.radius_m, model.height_m, model.rest_qpos, model.eye_height_m, *(leg.sole_m for leg in model.legs)]


def motion(file: Path, folder: Path) -> Any:
    recording = read_recording(file)
    quaternion = getattr(recording, "quaternion", None)
    if quaternion is not None:
        np.testing.assert_allclose(np.linalg.norm(quaternion, axis=1), 1.0, atol=0.05)
    return recording


def rollouts(file: Path, folder: Path) -> Any:
    """A file in place of a whole pair's own."""
    save_rollouts(folder, made_up(RobotModel.load(ROBOT)))
    shutil.copy(file, folder / file.name.rpartition("-")[2])
    found = load_rollouts(folder)
    for one in found:
        turns = one.camera_poses[:, :3, :3]
        np.testing.assert_allclose(turns @ turns.transpose(0, 2, 1), np.tile(np.eye(3), (len(turns), 1, 1)), atol=1e-3)
    return found


def declaration(file: Path, folder: Path) -> Any:
    shutil.copy(file, folder / "scene.toml")
    declared = Scene.open(folder).declaration
    robot_digest(declared.robot)
    return [declared.robot, declared.scope]


READERS = {
    "robot.xml": robot,
    "motion.npz": motion,
    "human.npz": motion,
    "human.motion": motion,
    "scope.toml": lambda file, folder: BehaviourScope.load(file),
    "knees.toml": lambda file, folder: PolicyLayout.load(file),
    "bundle_rounds_0_rollouts_rollouts.json": rollouts,
    "bundle_rounds_0_rollouts_rollouts.npz": rollouts,
    "bundle_scene.toml": declaration,
}
FILES = [file for kind in READERS for file in sorted((HOSTILE / kind).glob("*"))]


def infinities_allowed(value: Any) -> bool:
    """Whether all numbers in ``value`` are finite, or the infinity that says "no bound"."""
    if isinstance(value, np.ndarray):
        return value.dtype.kind not in "fc" or bool(np.isfinite(value).all())
    if is_dataclass(value):
        return all(map(infinities_allowed, vars(value).values()))
    if isinstance(value, (list, tuple)):
        return all(map(infinities_allowed, value))
    return not isinstance(value, float) or not math.isnan(value)


@pytest.mark.skipif(not FILES, reason=f"{HOSTILE} is not there")
@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}-{file.name[:8]}")
def test_what_failed_once_is_refused_in_a_sentence_or_clean(file, tmp_path):
    read = READERS[file.parent.name]
    began = time.process_time()
    try:
        value = read(file, tmp_path)
    except R2SEgoError as error:
        assert error.where and error.cure and len(str(error)) < 2500
    else:
        assert infinities_allowed(value)
    assert time.process_time() - began < 2.0
