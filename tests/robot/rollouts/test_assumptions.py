"""What rollouts take for granted is said before them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from progress_recorder import ProgressRecorder

from r2sego_blender.robot.rollouts.assumptions import tell_assumptions
from r2sego_blender.robot.scope.scope import BehaviourScope, Control


def test_an_assumed_rate_is_a_warning_and_a_declared_one_is_told(humanoid, tmp_path):
    np.savez(tmp_path / "declared.npz", qpos=np.tile(humanoid.rest_qpos, (51, 1)), dt=0.02)
    np.savez(tmp_path / "assumed.npz", qpos=np.tile(humanoid.rest_qpos, (51, 1)))
    motions = tuple(str(tmp_path / f"{name}.npz") for name in ("declared", "assumed"))
    scope = BehaviourScope.load("walk_and_look")
    heard = ProgressRecorder()
    tell_assumptions(humanoid, replace(scope, controller=Control(kind="replay", motions=motions)), heard)
    assert [level for level, _ in heard.messages] == ["info", "warning"]
    assert "1.00 s at 50 Hz" in heard.messages[0][1] and "1.67 s at 30 Hz" in heard.messages[1][1]
    tell_assumptions(humanoid, scope, heard)  # plays none
    assert len(heard.messages) == 2


def test_bounded_inertias_are_a_warning(humanoid):
    heard = ProgressRecorder()
    tell_assumptions(replace(humanoid, bounded_links=("lidar",)), BehaviourScope.load("walk_and_look"), heard)
    assert len(heard.warnings) == 1 and "lidar" in heard.warnings[0]
