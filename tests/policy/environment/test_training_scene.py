"""What is open already is another scene once a file that it was read from has changed."""

from __future__ import annotations

from pathlib import Path

import pytest
from training_room import training_room

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core.errors import AssetError
from r2sego_blender.policy.environment.training_scene import TrainingScene
from r2sego_blender.robot.model.humanoid import humanoid_mjcf

SCOPE = "[behaviours]\nsit_on = 1.0\n[sit_on]\nhold_s = {}\n"


def test_an_edited_scope_and_robot_are_read_again_and_nothing_else_is(tmp_path: Path):
    scope, robot, bundle = tmp_path / "scope.toml", tmp_path / "robot.xml", training_room(tmp_path / "room.r2s")
    scope.write_text(SCOPE.format(2.0))
    robot.write_text(humanoid_mjcf())
    Scene.open(bundle).declare(scope=str(scope), robot=str(robot))
    first = TrainingScene.open(bundle, sits=True)
    assert TrainingScene.open(bundle, sits=True) is first
    scope.write_text(SCOPE.format(1.0))
    second = TrainingScene.open(bundle, sits=True)
    assert (first.scope.sit_on.hold_s, second.scope.sit_on.hold_s) == (2.0, 1.0)
    robot.write_text(humanoid_mjcf().replace("floating_base_joint", "floats"))
    third = TrainingScene.open(bundle, sits=True)
    assert third.robot.model.joint(0).name == "floats" != second.robot.model.joint(0).name


def test_another_asset_that_is_not_there_is_named(tmp_path: Path):
    bundle, gone = training_room(tmp_path / "room.r2s"), tmp_path / "baseline.ply"
    with pytest.raises(AssetError) as raised:
        TrainingScene.open(bundle, sits=True, asset=str(gone))
    assert raised.value.where == str(gone)
