"""The attempts and the robot's bodies as Blender reads them, beside what the engine wrote."""

import dataclasses
import json
import shutil

import fake_rollouts
import numpy as np
import pytest
from expected_errors import refused

from r2sego_blender.core.errors import RobotError, SceneError
from r2sego_blender.results.panels.bundle import Bundle
from r2sego_blender.results.panels.robot_facts import RobotFacts
from r2sego_blender.results.panels.rollout_bodies import RobotBodies, are_written
from r2sego_blender.results.panels.rollout_list import TRIAL, attempts, camera_poses
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.rollouts.bodies import body_poses, body_shapes


@pytest.fixture(scope="module")
def robot():
    return RobotModel.load(fake_rollouts.ROBOT)


@pytest.fixture
def copied(bundle_path, tmp_path):
    shutil.copytree(bundle_path, tmp_path / "room.r2s")
    return Bundle.open(tmp_path / "room.r2s")


def test_every_attempt_is_listed_with_its_reason(bundle):
    listed = attempts(bundle, 1)
    assert [one.success for one in listed] == [True, False, False, True]
    assert [one.frames for one in listed] == list(fake_rollouts.FRAMES)
    assert (listed[1].reason, listed[1].detail) == ("body_contact", "mast touched the chair")
    assert [one.outcome for one in listed[:2]] == ["succeeded", "mast touched the chair"]
    assert dataclasses.replace(listed[1], detail="").outcome == "body contact"
    assert [one.frame for one in listed] == [10, 4, 0, 7]
    assert [one.time_s for one in listed] == pytest.approx([2.0, 0.8, 0.0, 1.4])
    assert len(attempts(bundle, TRIAL)) == 2


def test_bodies_are_those_of_forward_kinematics(bundle, robot):
    bodies = RobotBodies.load(bundle, 0)
    shapes = body_shapes(robot.model)
    assert bodies.names == tuple(shape.name for shape in shapes)
    assert bodies.rate_hz == 5.0
    assert (bodies.camera.width, bodies.camera.height) == (64, 48)
    for number, rollout in enumerate(fake_rollouts.rollouts(robot)):
        expected = body_poses(robot.model, rollout.qpos, [shape.body for shape in shapes])
        np.testing.assert_allclose(bodies.poses(number), expected, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(camera_poses(bundle, 0, number), rollout.camera_poses, atol=1e-12)
    for shape, (vertices, faces, colours) in zip(shapes, bodies.shapes, strict=True):
        np.testing.assert_array_equal(vertices, shape.vertices)
        np.testing.assert_array_equal(faces, shape.faces)
        np.testing.assert_array_equal(colours, shape.colours)


def test_bodies_of_other_rollouts_are_not_taken(copied):
    assert are_written(copied, 0) and are_written(copied, TRIAL)
    assert not are_written(copied, 1)
    with refused(SceneError, "rounds/1/bodies", "missing"):
        RobotBodies.load(copied, 1)
    file = copied.path / "rounds/0/rollouts/rollouts.npz"
    file.write_bytes((copied.path / "robot/trial/rollouts.npz").read_bytes())
    assert not are_written(copied, 0)


@pytest.mark.parametrize("text", ["", "{}", '{"rollouts": [{}]}', '{"rollouts": 3}'])
def test_a_damaged_list_is_told(copied, text):
    file = copied.path / "rounds/0/rollouts/rollouts.json"
    file.write_text(text)
    with refused(RobotError, file):
        attempts(copied, 0)


def test_what_is_told_of_a_list_that_is_no_text_does_not_hold_all_of_it(copied):
    (copied.path / "rounds/0/rollouts/rollouts.json").write_bytes(b"\xff" + b"a" * 5000)
    with refused(RobotError, "rollouts.json") as told:
        attempts(copied, 0)
    assert len(str(told.value)) < 1000


def test_damaged_bodies_are_told(copied):
    folder = copied.path / "rounds/0/bodies"
    np.savez(folder / "poses.npz", world_from_body_0000=np.zeros((3, 99, 4, 4)))
    with refused(SceneError, folder / "poses.npz"):
        RobotBodies.load(copied, 0).poses(0)
    (folder / "shapes.npz").write_bytes(b"PK")
    with refused(SceneError, folder / "shapes.npz"):
        RobotBodies.load(copied, 0)


def test_what_was_never_run_is_told(copied):
    with refused(SceneError, "rounds/7/rollouts", "round 7"):
        attempts(copied, 7)
    shutil.rmtree(copied.path / "robot")
    with refused(SceneError, "robot/trial"):
        attempts(copied, TRIAL)


def test_facts_are_the_scopes_and_the_engines(copied):
    facts = RobotFacts.read(copied)
    told = dict(facts.lines())
    assert told["Body"] == "29 joints, 2 legs, 1.31 m, 35 kg"
    assert told["Region"] == "the free floor" and facts.region == ()
    assert "Target" not in told
    assert [(seat.object_name, seat.places) for seat in facts.seats] == [("chair", 3), ("", 1)]


def test_facts_of_another_robot_are_left_out(copied):
    file = copied.path / "robot/robot.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "declared": ["a.xml", "walk_and_look"]}))
    facts = RobotFacts.read(copied)
    assert facts.told == {} and facts.seats == ()
    assert "Body" not in dict(facts.lines())


def test_the_bundles_own_scope_is_read_live(copied, tmp_path):
    own = copied.path / "robot" / "scope.toml"
    own.write_text(
        '[region]\nwithin = [[0, 0], [2, 0], [2, 1.5]]\n[behaviours]\nsit_on = 1\n[sit_on]\ntarget = "chair"'
    )
    changed = Bundle(copied.scene.declare(scope=str(own)))
    facts = RobotFacts.read(changed)
    assert facts.region == ((0.0, 0.0), (2.0, 0.0), (2.0, 1.5))
    assert dict(facts.lines())["Region"] == "polygon, 1.50 m²"
    assert dict(facts.lines())["Target"] == "chair"
    shutil.copytree(copied.path, tmp_path / "other.r2s")
    shutil.rmtree(copied.path / "robot")
    there = RobotFacts.read(Bundle.open(tmp_path / "other.r2s"))
    assert there.region == facts.region
    own.parent.mkdir()
    own.write_text("[region")
    with refused(RobotError, "robot/scope.toml", "TOML"):
        RobotFacts.read(changed)


@pytest.mark.parametrize(
    "wrong",
    [
        {"seats": 1},
        {"seats": ["a"]},
        {"seats": [{"object": "chair"}]},
        {"seats": [{"object": "chair", "place_m": [1.0], "height_m": 0.4, "places": 1}]},
        {"camera": [1.0]},
        {"camera": {"height_m": 1.0, "pitch_deg": "%s", "fov_deg": 55.0, "fov_is_vertical": True}},
        {"joints": "many"},
        {"cameras": {"head": 1}},
        {"declared": 3},
    ],
)
def test_facts_of_other_kinds_are_none(copied, wrong):
    file = copied.path / "robot/robot.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | wrong))
    facts = RobotFacts.read(copied)
    assert facts.told == {} and facts.seats == () and dict(facts.lines())
