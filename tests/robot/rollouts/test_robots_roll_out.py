"""Robots of any make walk and roll with nothing but a scope file that names them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from legged_robots import hexapod_mjcf, quadruped_mjcf

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.rollouts.rollouts import successful_rollouts
from r2sego_blender.robot.scope.scope import BehaviourScope

_WALKS = """
[behaviours]
walk_to = 1.0
look_around = 0.0

[episode]
duration_s = 6.0
"""
_H1_MOUNT = 'mount = ["torso_link", [0.10848, 0.0325, 0.69317], [0, 0.7, 0], {hfov_deg = 69}]'
_SETTINGS = RolloutSettings(successes=3, max_attempts=6, processes=1)


def walks_of(folder: Path, room: Path, robot: str) -> list:
    """Successful walks of the robot that a new scope file in ``folder`` names."""
    scope_file = folder / "scope.toml"
    scope_file.write_text(f"[robot]\n{robot}\n{_WALKS}")
    scope = BehaviourScope.load(scope_file)
    model = RobotModel.load(*scope.robot_for("embedded:humanoid"))
    rollouts = successful_rollouts(model, scope, room, _SETTINGS, seed=0)
    return [rollout for rollout in rollouts if rollout.success]


def assert_walked(walks: list, eye_m: tuple[float, float]) -> None:
    assert len(walks) == 3
    for walk in walks:
        places = walk.camera_poses[:, :3, 3]
        assert np.linalg.norm(np.diff(places[:, :2], axis=0), axis=1).sum() > 0.5
        assert eye_m[0] < places[:, 2].min() <= places[:, 2].max() < eye_m[1]
        assert walk.quality.foot_slide_m < 0.03
        assert walk.quality.penetration_m < 0.01


def test_quadruped(tmp_path, box_room):
    (tmp_path / "quadruped.xml").write_text(quadruped_mjcf())
    assert_walked(walks_of(tmp_path, box_room(), 'model = "quadruped.xml"'), (0.38, 0.52))


def test_hexapod(tmp_path, box_room):
    (tmp_path / "hexapod.xml").write_text(hexapod_mjcf())
    assert_walked(walks_of(tmp_path, box_room(), 'model = "hexapod.xml"'), (0.14, 0.21))


def test_wheeled_base(tmp_path, box_room):
    walks = walks_of(tmp_path, box_room(), 'model = "embedded:wheeled"')
    assert_walked(walks, (1.19, 1.21))
    for walk in walks:  # the wheels turn as far as the base goes
        turned = np.abs(np.diff(walk.qpos[:, 7:9], axis=0)).sum(axis=0)
        assert turned.min() > 3.0


def test_biped_whose_feet_cannot_roll(tmp_path, box_room, shared_robot):
    urdf = shared_robot("h1/h1/urdf/h1.urdf")
    assert_walked(walks_of(tmp_path, box_room(), f'model = "{urdf}"\n{_H1_MOUNT}'), (1.55, 1.75))


def test_what_takes_legs_is_refused_to_wheels(box_room):
    robot = RobotModel.load("embedded:wheeled")
    with pytest.raises(RobotError, match=r"behaviours\.sit_on takes legs, and embedded:wheeled has none"):
        successful_rollouts(robot, BehaviourScope.load("sit_down"), box_room(), _SETTINGS, seed=0)
