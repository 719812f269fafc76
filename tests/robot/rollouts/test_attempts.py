"""Attempts in several processes: the same bits in the same order, and errors that come back."""

from __future__ import annotations

import json
import multiprocessing
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.core.errors import NativeError, RobotError
from r2sego_blender.robot.behaviours.walk_to import WalkTo
from r2sego_blender.robot.planning.free_floor import free_floor
from r2sego_blender.robot.rollouts.attempts import Attempts, _processes, in_order
from r2sego_blender.robot.rollouts.candidates import candidate_stream
from r2sego_blender.robot.rollouts.rollouts import successful_rollouts
from r2sego_blender.robot.scope.scope import BehaviourScope, Episode

SCOPE = replace(
    BehaviourScope.load("walk_and_look"), episode=Episode(duration_s=2.0), walk_to=WalkTo(distance_m=(0.1, 1.0))
)


def test_the_number_of_processes_changes_nothing(humanoid, box_room):
    room = box_room()
    one, two = (
        successful_rollouts(humanoid, SCOPE, room, RolloutSettings(successes=4, processes=count), seed=5)
        for count in (1, 2)
    )
    assert len(one) == len(two)
    for first, second in zip(one, two, strict=True):
        np.testing.assert_array_equal(first.qpos, second.qpos)
        np.testing.assert_array_equal(first.camera_poses, second.camera_poses)
        arrays = {"qpos": 0, "times_s": 0, "camera_poses": 0}
        assert replace(first, **arrays) == replace(second, **arrays)


def test_a_large_machine_simulates_on_windows_too():
    """Windows refuses a pool of more than 61 processes."""
    assert [_processes(128, system) for system in ("nt", "posix")] == [61, 128]
    assert _processes(4, "nt") == 4


@pytest.mark.parametrize("processes", [1, 2])
def test_a_scene_without_seats_is_told(humanoid, box_room, processes):
    sit_down = replace(BehaviourScope.load("sit_down"), region=SCOPE.region)
    settings = RolloutSettings(successes=1, processes=processes)
    with pytest.raises(RobotError, match="there is no seat"):
        successful_rollouts(humanoid, sit_down, box_room(()), settings, seed=0)


def test_a_process_that_is_killed_is_told(humanoid, box_room):
    """As the system does that is short of memory."""
    room, settings = box_room(), RolloutSettings(processes=2)
    floor = free_floor(humanoid, SCOPE, room)
    tried = in_order(Attempts(humanoid.source, humanoid.mount, SCOPE, floor, room, settings, 5))
    before = set(multiprocessing.active_children())
    next(tried)
    for child in set(multiprocessing.active_children()) - before:
        child.kill()
    with pytest.raises(NativeError, match="a process that simulates died"):
        for _ in range(20):
            next(tried)


UNGUARDED = """
import json, sys
from dataclasses import replace
from pathlib import Path

from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.rollouts.rollouts import successful_rollouts
from r2sego_blender.robot.behaviours.walk_to import WalkTo
from r2sego_blender.robot.scope.scope import BehaviourScope, Episode
from r2sego_blender.config.settings import RolloutSettings

print("started", file=sys.stderr)
scope = BehaviourScope.load("walk_and_look")
scope = replace(scope, episode=Episode(duration_s=2.0), walk_to=WalkTo(distance_m=(0.1, 1.0)))
settings = RolloutSettings(successes=2, processes=2)
found = successful_rollouts(RobotModel.load(), scope, Path(sys.argv[1]), settings, seed=5)
print(json.dumps([rollout.qpos[-1].tolist() for rollout in found]))
print(__spec__, Path(__file__).name, file=sys.stderr)
"""


@pytest.mark.parametrize("as_module", [False, True])
def test_a_script_without_the_usual_guard_is_run_once(humanoid, box_room, tmp_path, as_module):
    (tmp_path / "unguarded.py").write_text(UNGUARDED)
    room, settings = box_room(), RolloutSettings(successes=2, processes=1)
    script = ["-m", "unguarded"] if as_module else ["unguarded.py"]
    done = subprocess.run(
        [sys.executable, *script, str(room)], cwd=tmp_path, capture_output=True, text=True, timeout=1200
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("started") == 1
    # __main__ is what it was
    assert "unguarded.py" in done.stderr and ("name='unguarded'" in done.stderr) == as_module
    expected = successful_rollouts(humanoid, SCOPE, room, settings, seed=5)
    np.testing.assert_array_equal(json.loads(done.stdout), [rollout.qpos[-1] for rollout in expected])


def test_blurred_frames_are_no_candidates(humanoid, box_room):
    attempts = successful_rollouts(humanoid, SCOPE, box_room(), RolloutSettings(successes=3, processes=1), seed=1)
    every, steady = candidate_stream(attempts), candidate_stream(attempts, max_turn_deg_s=20.0)
    assert 0 < len(steady) < len(every)
    kept = {(int(r), int(f)) for r, f in zip(steady.rollout, steady.frame, strict=True)}
    accepted = [attempt for attempt in attempts if attempt.success]
    for rollout, attempt in enumerate(accepted):
        for frame in range(len(attempt.times_s) - 1):
            turn = attempt.camera_poses[frame, :3, :3].T @ attempt.camera_poses[frame + 1, :3, :3]
            seconds = attempt.times_s[frame + 1] - attempt.times_s[frame]
            rate = np.degrees(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0))) / seconds
            if rate > 20.0 + 1e-6:
                assert (rollout, frame) not in kept and (rollout, frame + 1) not in kept
    for index in range(len(steady)):
        pose = accepted[steady.rollout[index]].camera_poses[steady.frame[index]]
        np.testing.assert_array_equal(steady.poses[index], pose)
