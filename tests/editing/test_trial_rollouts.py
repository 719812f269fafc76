"""A trial makes the attempts a round would make, and leaves every round as it is."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_room import made_up_bundle
from seeing_networks import seeing_network
from step_reads import KeysOnly

from r2sego_blender.bundle.runner import Runner
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import SceneError
from r2sego_blender.core.progress import SILENT
from r2sego_blender.editing.robot_declaration import declare_robot
from r2sego_blender.editing.trial_rollouts import TRIAL, try_rollouts
from r2sego_blender.geometry.collision.collision_files import COLLISION
from r2sego_blender.geometry.proxy.proxy import PROXY
from r2sego_blender.refine.capture_steps import AlignedPriors, RegisteredCaptures
from r2sego_blender.refine.steps import Steps
from r2sego_blender.results.robot_bodies import export_bodies
from r2sego_blender.robot.controllers.drive_actions import proprioception_size
from r2sego_blender.robot.rollouts.rollout import load_rollouts
from r2sego_blender.splats.artifacts import INITIAL_ASSET
from r2sego_blender.splats.formats.ply import save_ply
from tools.benchmarks.workloads import made_up_room

ROOT = Path(__file__).parents[2]
LINE_8 = 0, RegisteredCaptures(), AlignedPriors(), PROXY.of_round(0), COLLISION.of_round(0), INITIAL_ASSET
"""What the first round's rollouts are made of."""
SHORT = {"episode.duration_s": 1.0, "walk_to.distance_m": [0.1, 0.6]}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    made = made_up_bundle(tmp_path_factory.mktemp("trial") / "room.r2s", **{"rollouts.successes": 2})
    return declare_robot(made, changes=SHORT)


@pytest.fixture(scope="module")
def round_rollouts(scene):
    """What the round itself makes of the same scope."""
    steps = Steps(Runner(scene), scene.declaration.settings, SILENT)
    proxy, collision = PROXY.of_round(0), COLLISION.of_round(0)
    return scene.read(
        steps.successful_ego_poses(0, RegisteredCaptures(), AlignedPriors(), proxy, collision, INITIAL_ASSET)
    )


def test_a_trial_is_the_first_of_a_round(scene, round_rollouts):
    before = content_digest(scene.path / "rounds")
    tried = try_rollouts(scene, 2)
    assert content_digest(scene.path / "rounds") == before
    assert len(tried) == 2
    for one, other, kept in zip(tried, round_rollouts, load_rollouts(scene.path / TRIAL), strict=False):
        assert (one.success, one.reason, one.seed) == (other.success, other.reason, other.seed)
        np.testing.assert_array_equal(one.qpos, other.qpos)
        np.testing.assert_array_equal(kept.camera_poses, other.camera_poses)
    assert (scene.path / TRIAL / "bodies.json").is_file()


def test_a_student_is_shown_the_asset_of_the_round_and_no_one_else_is(tmp_path):
    pytest.importorskip("onnx", reason="make install POLICY=1")
    made = made_up_bundle(tmp_path / "room.r2s", **{"rollouts.max_attempts": 1})
    student = seeing_network(tmp_path / "student.onnx", proprioception_size(29))
    sits = {"controller.kind": "student", "controller.file": str(student), "episode.duration_s": 0.5}
    sits |= {"behaviours.walk_to": 0.0, "behaviours.look_around": 0.0, "behaviours.sit_on": 1.0}
    told = {}
    for name, declared in (("student", declare_robot(made, changes=sits)), ("reference", made)):
        runner = KeysOnly(declared)
        Steps(runner, declared.declaration.settings, SILENT).successful_ego_poses(*LINE_8)
        (told[name],) = runner.keys.values()
    assert set(told["student"][0]) - set(told["reference"][0]) == {INITIAL_ASSET.name, str(student)}
    (made.path / INITIAL_ASSET.name).parent.mkdir(exist_ok=True)
    paths = []
    for brightness in (0.1, 0.9):
        asset = made_up_room(500, (64, 48)).asset
        save_ply(made.path / INITIAL_ASSET.name, replace(asset, sh=np.full_like(asset.sh, brightness)))
        (rollout,) = try_rollouts(Scene.open(made.path), 1)
        assert rollout.controller == f"student {student.name}"
        paths.append(rollout.qpos)
    assert np.array_equal(paths[0][0], paths[1][0]) and not np.array_equal(paths[0][-1], paths[1][-1])


def test_the_command_counts_what_failed(scene):
    command = ["try-rollouts", str(scene.path), "--attempts", "1", "--json-progress"]
    done = subprocess.run([sys.executable, "-m", "r2sego_blender", *command], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout.strip().splitlines()[-1])
    assert result["attempts"] == 1
    assert result["succeeded"] + sum(result["failures"].values()) == 1
    assert len(load_rollouts(scene.path / TRIAL)) == 1


def test_bodies_of_a_round_are_made_once(scene, round_rollouts):
    folder = export_bodies(scene, 0)
    assert folder == scene.path / "rounds/0/bodies"
    made = (folder / "poses.npz").stat().st_mtime_ns
    assert export_bodies(scene, 0) == folder
    assert (folder / "poses.npz").stat().st_mtime_ns == made
    described = json.loads((folder / "bodies.json").read_text())
    assert described["rollouts"] == content_digest(scene.path / "rounds/0/rollouts/rollouts.npz")
    assert described["camera_rate_hz"] == 5.0
    with pytest.raises(SceneError, match="round 1 has no rollouts"):
        export_bodies(scene, 1)


def test_without_a_surface_there_is_nothing_to_try(tmp_path):
    made = made_up_bundle(tmp_path / "room.r2s")
    (made.path / "rounds/0/collision/scene.xml").unlink()
    with pytest.raises(SceneError, match="no collision surface"):
        try_rollouts(made, 1)


def test_a_surface_of_an_earlier_world_frame_is_not_tried(tmp_path):
    made = made_up_bundle(tmp_path / "room.r2s")
    mjcf = (made.path / "rounds/0/collision/scene.xml").read_text()
    Runner(made).step("rounds/0/collision", lambda folder: (folder / "scene.xml").write_text(mjcf))
    larger = made.declare(world_from_capture=tuple(map(tuple, np.diag([1.1, 1.1, 1.1, 1.0]).tolist())))
    with pytest.raises(SceneError, match=r"0.collision: the ground or the scale was corrected since"):
        try_rollouts(larger, 1)


def test_the_settings_are_the_rounds(scene):
    assert scene.declaration.settings.rollouts == RolloutSettings(successes=2, processes=1)
