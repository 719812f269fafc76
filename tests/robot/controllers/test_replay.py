"""Recorded motions in a room: where they are placed, how they are followed, what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.behaviours.trajectory import RATE_HZ
from r2sego_blender.robot.controllers.motion_placement import moved, placed_on_floor, seated_span
from r2sego_blender.robot.controllers.replay import ReplayController, gait_of, load_take
from r2sego_blender.robot.model.composition import compose
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.motion.motion import plan_motion
from r2sego_blender.robot.planning.free_floor import CELL_M, FreeFloor, free_floor
from r2sego_blender.robot.planning.seats import find_seats
from r2sego_blender.robot.rollouts.attempts import Attempts
from r2sego_blender.robot.rollouts.rollout import Rollout
from r2sego_blender.robot.rollouts.rollouts import successful_rollouts
from r2sego_blender.robot.scope.scope import Behaviours, BehaviourScope, Control, Episode, Failures, Region

SCOPE = BehaviourScope.load("walk_and_look")
G1 = "g1/unitree_mujoco_g1/g1_29dof.xml"
G1_MOUNT = ["torso_link", [0.0576235, 0.01753, 0.42987], [0.0, 0.8307767, 0.0], {"hfov_deg": 69.0}]
MOTIONS = "g1/motions/"
# Recordings are no references of ours: their feet turn as they stand.
LENIENT = Failures(slide_m=0.0, penetration_m=0.05)


def replaying(*motions: Path, duration_s: float = 8.0, failures: Failures = LENIENT) -> BehaviourScope:
    control = Control(kind="replay", motions=tuple(str(path) for path in motions))
    return replace(SCOPE, controller=control, episode=Episode(duration_s=duration_s), failures=failures)


def rollouts(robot: RobotModel, scene: Path, scope: BehaviourScope, count: int) -> list[Rollout]:
    floor = free_floor(robot, scope, scene)
    attempts = Attempts(robot.source, robot.mount, scope, floor, scene, RolloutSettings(), 3)
    return [attempts.run(number) for number in range(count)]


@pytest.fixture(scope="module")
def walk(humanoid, box_room, tmp_path_factory) -> tuple[Path, np.ndarray]:
    """A recorded walk: a reference motion of this project's own, as a table."""
    scope = replace(SCOPE, behaviours=Behaviours(walk_to=1.0, look_around=0.0), episode=Episode(duration_s=4.0))
    floor = free_floor(humanoid, scope, box_room())
    motion = plan_motion(humanoid, floor, scope, np.random.default_rng(2), None)
    path = tmp_path_factory.mktemp("motions") / "walk.csv"
    np.savetxt(path, motion.qpos, delimiter=",", header=f"rate_hz = {RATE_HZ}, quaternion = wxyz")
    return path, motion.qpos


def empty_floor(free: np.ndarray) -> FreeFloor:
    return FreeFloor(np.array([-1.0, 0.5]), free, free, np.zeros(free.shape), 0.0)


# Placing


def test_moving_is_rigid():
    rng = np.random.default_rng(0)
    qpos = rng.normal(size=(20, 9))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    found = moved(qpos, 0.7, np.array([2.0, -1.0]), 0.25)
    np.testing.assert_array_equal(found[:, 7:], qpos[:, 7:])
    between = [Rotation.from_quat(q[:, 3:7], scalar_first=True) for q in (qpos, found)]
    steps = [turns[:-1].inv() * turns[1:] for turns in between]
    assert (steps[0].inv() * steps[1]).magnitude().max() < 1e-9
    local = [turns.inv().apply(q[:, :3] - q[0, :3]) for turns, q in zip(between, (qpos, found), strict=True)]
    np.testing.assert_allclose(local[0], local[1], atol=1e-9)
    np.testing.assert_allclose(found[:, 2], qpos[:, 2] + 0.25)
    np.testing.assert_allclose(moved(found, -0.7, np.zeros(2))[:, 7:], qpos[:, 7:])


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), share=st.floats(0.3, 1.0), length=st.floats(0.0, 1.5))
def test_placed_roots_keep_to_the_free_floor(seed, share, length):
    rng = np.random.default_rng(seed)
    free = rng.random((50, 60)) < 1.0
    holes = rng.integers(0, (50, 60), size=(round(20 * (1.0 - share)), 2))
    for row, column in holes:
        free[max(0, row - 3) : row + 4, max(0, column - 3) : column + 4] = False
    floor = empty_floor(free)
    qpos = np.zeros((40, 8))
    qpos[:, 3] = 1.0
    qpos[:, 0] = np.linspace(0.0, length, 40)
    qpos[:, 1] = 0.2 * np.sin(np.linspace(0.0, 3.0, 40)) * length
    found = placed_on_floor(qpos, floor, rng)
    if found is None:
        assert length > 0.3
        return
    # The grid holds a root for free in cells up to a cell off.
    inside = (found[:, :2] > floor.origin_m - CELL_M).all() and (
        found[:, :2] < floor.origin_m + CELL_M * np.array([60, 50])
    ).all()
    assert inside
    assert floor.is_free(found[:, :2]).mean() > 0.95
    assert floor.is_free(found[0, :2])


def test_what_does_not_fit_is_not_placed():
    free = np.zeros((40, 40), bool)
    free[18:22, 18:22] = True
    qpos = np.zeros((40, 8))
    qpos[:, 3] = 1.0
    rng = np.random.default_rng(0)
    assert placed_on_floor(qpos, empty_floor(free), rng) is not None
    qpos[:, 0] = np.linspace(0.0, 1.0, 40)
    assert placed_on_floor(qpos, empty_floor(free), rng) is None
    qpos[:, 0] = np.linspace(0.0, 100.0, 40)
    assert placed_on_floor(qpos, empty_floor(free), rng) is None


def test_a_rest_on_a_seat_is_found(humanoid):
    qpos = np.tile(humanoid.rest_qpos, (400, 1))
    qpos[150:300, 2] = 0.6 * humanoid.rest_height_m
    assert seated_span(qpos, humanoid) == (151, 298)
    qpos[170:300, 2] = humanoid.rest_height_m  # no longer than a glance
    assert seated_span(qpos, humanoid) is None


# Following


def test_a_walk_is_followed_within_degrees(humanoid, walk, box_room):
    """The joints of a replayed motion, and the base's way, come out as they were recorded."""
    path, recorded = walk
    take = load_take(path, humanoid)
    np.testing.assert_allclose(take.qpos[:, 19:], recorded[: len(take.qpos), 19:], atol=2e-3)
    legs_deg = np.degrees(np.abs(take.qpos[:, 7:19] - recorded[: len(take.qpos), 7:19]))
    assert np.median(legs_deg) < 1.0 and legs_deg.max() < 15.0
    scope = replaying(path, duration_s=4.0)
    for rollout in rollouts(humanoid, box_room(), scope, 3):
        assert rollout.success, rollout.detail
        assert rollout.behaviour == "walk"
        assert rollout.controller == "replay walk.csv"
        at = np.rint(rollout.times_s * RATE_HZ).astype(int)
        reference = take.qpos[np.minimum(at, len(take.qpos) - 1)]
        away_deg = np.degrees(np.abs(rollout.qpos[1:, 7:] - reference[1:, 7:]))
        assert np.median(away_deg) < 1.0
        assert np.quantile(away_deg, 0.95) < 6.0
        # The base moves as in the recording, turned and moved as a whole.
        lengths = [np.linalg.norm(q[:, :2] - q[0, :2], axis=1) for q in (rollout.qpos, reference)]
        np.testing.assert_allclose(lengths[0], lengths[1], atol=0.04)
        assert rollout.quality.assist_n < 60.0


def test_the_same_seed_places_the_same_and_another_elsewhere(humanoid, walk, box_room):
    scope = replaying(walk[0], duration_s=2.0)
    scene = box_room()
    floor = free_floor(humanoid, scope, scene)
    controller = ReplayController(humanoid, floor, scope, scene, RolloutSettings())
    starts = []
    for seed in range(6):
        first, again = (controller.draw(np.random.default_rng(seed)) for _ in range(2))
        np.testing.assert_array_equal(first.qpos, again.qpos)
        assert floor.is_free(first.qpos[:2])
        assert first.duration_s == 2.0
        starts.append(first.qpos[:2])
    assert np.linalg.norm(np.diff(starts, axis=0), axis=1).min() > 1e-3


def test_replay_begins_with_the_motion_s_velocity(humanoid, walk, box_room):
    scope = replaying(walk[0], duration_s=1.0)
    scene = box_room()
    controller = ReplayController(humanoid, free_floor(humanoid, scope, scene), scope, scene, RolloutSettings())
    drive = controller.draw(np.random.default_rng(4))
    data = mujoco.MjData(controller.composition.model)
    data.qpos[:] = drive.qpos
    drive.apply(data, 0)
    assert np.linalg.norm(data.qvel) > 0.1
    moving = data.qvel.copy()
    data.qvel[:] = 0.0
    drive.apply(data, 1)
    assert not data.qvel.any() and moving.any()


def test_loads_belong_to_feet_that_stand(humanoid, walk):
    take = load_take(walk[0], humanoid)
    gait = gait_of(humanoid, take.qpos, 0.0)
    np.testing.assert_allclose(gait.load.sum(axis=0), 1.0)
    high = gait.feet[..., 2] > 0.035
    assert high.any()
    assert gait.load[high].max() < 0.3
    assert np.median(gait.load[high]) < 0.02
    alone = high[::-1]
    assert np.median(gait.load[alone]) > 0.98


def test_motions_that_do_not_fit_have_no_goal(humanoid, walk, box_room):
    scope = replaying(walk[0], duration_s=4.0)
    corner = ((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2))
    scope = replace(scope, region=replace(scope.region, within=corner))
    (rollout,) = rollouts(humanoid, box_room(()), scope, 1)
    assert (rollout.success, rollout.reason) == (False, "no_goal")


def test_a_robot_without_legs_replays_nothing(wheeled, walk):
    with pytest.raises(RobotError, match=r"the robot has no legs to replay a motion with"):
        load_take(walk[0], wheeled)


@pytest.mark.slow
def test_a_recorded_sitting_down_ends_on_the_scene_s_seat(humanoid, box_room, tmp_path):
    """A motion planned for one chair, recorded, is replayed on another of another height."""
    sits = Behaviours(walk_to=0.0, look_around=0.0, sit_on=1.0)

    def chair(height_m: float) -> Path:
        half = height_m / 2.0
        return box_room(((1.2, 1.2, 0.3, 0.35, half), (1.2, 1.62, 0.3, 0.07, 0.4)))

    planned = replace(SCOPE, behaviours=sits, episode=Episode(duration_s=14.0))
    first = chair(0.40)
    floor = free_floor(humanoid, planned, first)
    seats = find_seats(humanoid.half_width_m, floor, planned.sit_on, first)
    composition = compose(humanoid, first, RolloutSettings())
    drawn = (
        plan_motion(humanoid, floor, planned, np.random.default_rng(seed), seats, composition) for seed in range(20)
    )
    motion = next(motion for motion in drawn if motion is not None)
    path = tmp_path / "sit.csv"
    np.savetxt(path, motion.qpos, delimiter=",", header=f"rate_hz = {RATE_HZ}, quaternion = wxyz")
    scope = replace(replaying(path, duration_s=12.0), behaviours=sits)
    found = rollouts(humanoid, chair(0.36), scope, 4)
    succeeded = [rollout for rollout in found if rollout.success]
    assert succeeded, [rollout.detail for rollout in found]
    for rollout in succeeded:
        assert rollout.quality.seated_s >= 3.0
        assert rollout.behaviour == "sit"
        assert rollout.qpos[-1, 2] < motion.qpos[-1, 2] - 0.02


def test_a_motion_that_fits_nowhere_is_told_as_such(humanoid, walk, box_room):
    cramped = replace(replaying(walk[0]), region=Region(within=((0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5))))
    with pytest.raises(RobotError) as raised:
        successful_rollouts(humanoid, cramped, box_room(), RolloutSettings(max_attempts=2), seed=0)
    assert "motion" in raised.value.what and "episode.duration_s" in raised.value.cure
    assert "walk_to" not in str(raised.value)


def test_what_cannot_be_replayed_is_refused(humanoid, walk, box_room, tmp_path):
    scene = box_room()

    def made(scope: BehaviourScope) -> ReplayController:
        return ReplayController(humanoid, free_floor(humanoid, scope, scene), scope, scene, RolloutSettings())

    with pytest.raises(RobotError, match=r"controller.motions is empty"):
        made(replaying())
    with pytest.raises(RobotError, match=r"nowhere.csv: this motion cannot be read"):
        made(replaying(tmp_path / "nowhere.csv"))
    short = tmp_path / "short.csv"
    np.savetxt(short, walk[1][:10], delimiter=",", header="rate_hz = 50")
    with pytest.raises(RobotError, match=r"short.csv: the motion lasts 0.2 s"):
        made(replaying(short))
    np.savetxt(short, walk[1][:2], delimiter=",", header="rate_hz = 1000")  # no second frame at the robot's rate
    with pytest.raises(RobotError, match=r"short.csv: the motion lasts 0.0 s"):
        made(replaying(short))
    sitting = replace(replaying(walk[0]), behaviours=Behaviours(sit_on=1.0))
    with pytest.raises(RobotError, match=r"no motion sits for sit_on.hold_s = 3 s. Set behaviours.sit_on to 0"):
        made(sitting)


# The shared recordings


@pytest.fixture(scope="module")
def g1(shared_robot) -> RobotModel:
    return RobotModel.load(shared_robot(G1), G1_MOUNT)


def test_shared_recordings_are_followed(g1, shared_robot, box_room):
    motions = [shared_robot(f"{MOTIONS}{name}.csv") for name in ("output_walk", "output_wave")]
    found = rollouts(g1, box_room(), replaying(*motions, duration_s=3.0), 6)
    assert {rollout.behaviour for rollout in found} == {"output_walk", "output_wave"}
    succeeded = {rollout.behaviour for rollout in found if rollout.success}
    assert succeeded == {"output_walk", "output_wave"}
    assert sum(rollout.success for rollout in found) >= 4
    for rollout in found:
        assert rollout.reason in {"", "body_contact"}, rollout.detail
        assert rollout.controller == "replay 2 motions"


@pytest.mark.slow
def test_a_dance_is_followed_where_it_keeps_to_the_scope(g1, shared_robot, box_room):
    scope = replaying(shared_robot(MOTIONS + "dance1_subject2.csv"), duration_s=4.0)
    found = rollouts(g1, box_room(()), scope, 6)
    assert sum(rollout.success for rollout in found) >= 2
    for rollout in found:
        assert rollout.success or rollout.detail


@pytest.mark.slow
def test_a_human_walks_to_a_seat_and_sits_down(g1, shared_robot, box_room):
    """The whole way: SMPL bodies to the robot, onto a chair of the scene, tracked until seated."""
    chair = ((1.2, 1.2, 0.3, 0.35, 0.18), (1.2, 1.62, 0.3, 0.07, 0.4))
    scope = replaying(shared_robot(MOTIONS + "smpl_humanoid_sit_armchair.motion"), duration_s=10.0)
    scope = replace(scope, behaviours=Behaviours(walk_to=0.0, look_around=0.0, sit_on=1.0))
    found = rollouts(g1, box_room(chair), scope, 5)
    succeeded = [rollout for rollout in found if rollout.success]
    assert succeeded
    for rollout in succeeded:
        assert rollout.quality.seated_s >= 3.0
        assert rollout.qpos[-1, 2] < 0.7 * g1.rest_height_m
        assert math.dist(rollout.qpos[0, :2], rollout.qpos[-1, :2]) > 0.3
