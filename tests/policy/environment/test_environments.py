"""The Gymnasium environments: their contract, what sitting and walking is, and the same bytes from the same seed."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from training_room import SEAT_HEIGHT_M

from r2sego_blender.core.errors import R2SEgoError, RobotError, SettingsError
from r2sego_blender.core.images import to_uint8
from r2sego_blender.policy.environment.environments import SitEnv, WalkEnv
from r2sego_blender.policy.environment.randomization import Randomization
from r2sego_blender.robot.behaviours.trajectory import STAND_OFF_M
from r2sego_blender.splats.rendering.rasterizer import render

SIT, WALK = "r2sego_blender.policy:r2sego/Sit-v0", "r2sego_blender.policy:r2sego/Walk-v0"
STILL, SIT_DOWN = (np.array([0, 0, 0, sit], np.float32) for sit in (-1, 1))
AHEAD, TURN = np.array([0.8, 0, 0, -1], np.float32), np.array([0, 0, 0.9, -1], np.float32)
PLAIN = Randomization.none()


@pytest.fixture(scope="module")
def sit(bundle) -> SitEnv:
    return SitEnv(bundle, randomization=PLAIN, render_mode="rgbd_tuple")


@pytest.fixture(scope="module")
def walk(bundle) -> WalkEnv:
    return WalkEnv(bundle)


def before(seat, away_m: float = STAND_OFF_M) -> dict:
    """Options to begin with the back to a seat."""
    return {"start": (*seat.ahead(away_m), seat.yaw_rad)}


def run(env, actions, **reset) -> list:
    """Everything an episode gives, as bytes and plain numbers."""
    observation, info = env.reset(**reset)
    told = [(observation, info)]
    for action in actions:
        observation, reward, terminated, truncated, info = env.step(action)
        told.append((observation, reward, terminated, truncated, info))
        if terminated or truncated:
            break
    return told


def digest(told: list) -> list:
    return [
        [{k: v.tobytes() for k, v in one[0].items()}, *one[1:-1], vars(one[-1]["state"]) | {"seat": None}]
        for one in told
    ]


@pytest.mark.parametrize("name", [SIT, WALK])
@pytest.mark.filterwarnings("error::UserWarning")
def test_gymnasiums_checker_has_nothing_to_say(name, bundle):
    env = gymnasium.make(name, bundle=bundle, render_mode="rgb_array", chairs=("stool",) if name == WALK else ())
    assert env.metadata["render_fps"] == 10 and env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    check_env(env.unwrapped, skip_render_check=name == WALK)


def test_an_observation_is_the_heads_picture_and_what_the_body_feels(sit):
    observation, info = sit.reset(seed=3)
    state = info["state"]
    assert observation["head"].shape == (96, 128, 3) and observation["head"].std() > 1.0
    gravity, spin, joints, speeds, last = np.split(observation["proprio"], [3, 6, 35, 64])
    np.testing.assert_allclose(gravity, (0.0, 0.0, -1.0), atol=1e-3)
    assert not last.any() and np.abs(speeds).max() < 1e-6 and np.abs(spin).max() < 1e-6
    assert 0.01 < np.abs(joints).max() < 1.5  # the drive's knees are bent
    assert state.seat.height_m == pytest.approx(SEAT_HEIGHT_M) and state.goal_xy_m is None
    assert (state.time_s, state.failure, state.is_seated) == (0.0, "", False)
    turned = run(sit, [TURN] * 5, seed=3)[-1]
    spin = turned[0]["proprio"][3:6]
    assert spin[2] == pytest.approx(0.9 * sit.limits.yaw_rate_rad_s[1], rel=0.3)
    np.testing.assert_array_equal(turned[0]["proprio"][-4:], TURN)
    assert turned[-1]["state"].time_s == pytest.approx(0.5)
    assert turned[-1]["state"].yaw_rad - state.yaw_rad == pytest.approx(0.25, abs=0.15)


def test_rgb_and_depth_in_metres_are_of_one_moment(sit):
    observation, _ = sit.reset(seed=3)
    colour, depth_m = sit.render()
    np.testing.assert_array_equal(colour, observation["head"])
    assert depth_m.shape == (96, 128) and depth_m.dtype == np.float32
    robot, asset = sit.scene.robot, sit.scene.asset.asset()
    pose = robot.camera_poses(sit._episode.data.qpos[None])[0]
    rendered = render(asset, robot.mount.camera(128, 96).at(pose))
    np.testing.assert_array_equal(colour, to_uint8(rendered.colour))
    np.testing.assert_array_equal(depth_m, rendered.depth)


def test_the_same_seed_gives_the_same_bytes_whatever_was_before(bundle, walk):
    actions = [AHEAD, TURN, AHEAD]
    first = digest(run(walk, actions, seed=5))
    run(walk, [TURN] * 3, seed=6)
    again = digest(run(walk, actions, seed=5))
    fresh = digest(run(WalkEnv(bundle), actions, seed=5))
    for other in (again, fresh):
        assert str(other) == str(first)
    assert str(digest(run(walk, actions, seed=7))) != str(first)


def test_vectors_in_this_process_and_in_others_are_the_same(bundle):
    told = []
    for mode, options in (("sync", {}), ("async", {"context": "spawn"})):
        env = gymnasium.make_vec(
            WALK, 2, vectorization_mode=mode, vector_kwargs=options, bundle=bundle, max_seconds=0.2
        )
        assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
        seen = [env.reset(seed=[1, 2])[0]]
        for _ in range(4):  # through the end of both episodes and into the next
            observation, reward, terminated, truncated, _ = env.step(np.stack([AHEAD, TURN]))
            seen += [observation, {"ends": np.stack([reward, terminated, truncated])}]
        env.close()
        told.append(seen)
    for here, there in zip(*told, strict=True):
        for key, values in here.items():
            np.testing.assert_array_equal(values, there[key])
    assert told[0][4]["ends"][2].all()


def test_sitting_down_before_the_seat_succeeds_once_it_has_carried_the_robot(sit):
    seat = sit.scene.seats[0]
    told = run(sit, [SIT_DOWN] * 120, seed=0, options=before(seat))
    *_, reward, terminated, truncated, info = told[-1]
    state = info["state"]
    assert (reward, terminated, truncated, info["is_success"], state.failure) == (1.0, True, False, True, "")
    assert state.is_seated and state.seated_s == pytest.approx(sit.scene.scope.sit_on.hold_s, abs=0.11)
    assert SEAT_HEIGHT_M < state.base_height_m < SEAT_HEIGHT_M + 0.2
    assert state.mean_assist_n > 0.0
    rewards = [one[1] for one in told[1:-1]]
    assert not any(rewards)


def test_sitting_too_early_misses_the_seat(sit):
    told = run(sit, [SIT_DOWN] * 100, seed=0, options=before(sit.scene.seats[0], 0.7))
    assert not told[-1][-1]["is_success"]
    assert max(one[-1]["state"].seated_s for one in told) < sit.scene.scope.sit_on.hold_s


def test_walking_into_the_wall_fails_and_time_runs_out(bundle, sit):
    told = run(sit, [AHEAD] * 60, seed=0, options={"start": (-1.0, 1.3, np.pi / 2)})
    *_, reward, terminated, truncated, info = told[-1]
    assert (reward, terminated, truncated) == (0.0, True, False)
    assert info["state"].failure in ("body_contact", "left_region") and info["detail"]
    short = SitEnv(bundle, randomization=PLAIN, max_seconds=0.3)
    told = run(short, [STILL] * 10, seed=0)
    assert len(told) == 4 and told[-1][3] and not told[-1][2]
    assert told[-1][-1]["state"].failure == "missed_target"


def test_who_stands_at_the_goal_has_walked(walk):
    _, info = walk.reset(seed=2)
    goal = info["state"].goal_xy_m
    told = run(walk, [STILL] * 12, seed=2, options={"start": (*goal, 0.0)})
    assert told[-1][-1]["is_success"] and told[-1][2] and len(told) > 5
    away, _ = walk.reset(seed=2, options={"start": (*(goal - (1.0, 0.0)), np.pi / 2)})
    np.testing.assert_allclose(away["goal"], (0.0, -1.0), atol=1e-3)


def test_an_older_picture_is_shown_where_there_is_latency(bundle, sit):
    late = SitEnv(bundle, randomization=replace(PLAIN, latency_s=(0.1, 0.1)))
    actions = [TURN] * 6
    now, then = (run(env, actions, seed=4) for env in (sit, late))
    for step in range(1, len(then)):
        np.testing.assert_array_equal(then[step][0]["head"], now[step - 1][0]["head"])
        np.testing.assert_array_equal(then[step][0]["proprio"], now[step][0]["proprio"])
    assert (now[-1][0]["head"] != now[-2][0]["head"]).mean() > 0.2


def test_a_separate_chair_is_seen_stands_on_the_free_floor_and_carries_who_sits_on_it(bundle):
    env = SitEnv(bundle, chairs=("dining",), randomization=PLAIN)
    _, info = env.reset(seed=1)
    seat = info["state"].seat
    assert env.scene.floor.is_free(np.array(seat.edge_m)) and not env.floor.is_free(np.array(seat.edge_m))
    assert env.floor.is_free(seat.ahead(seat.approach_m)) and env.floor.is_free(info["state"].base_xy_m)
    face = {"start": (*seat.ahead(1.2), seat.yaw_rad + np.pi)}
    with_chair, _ = env.reset(seed=1, options=face)
    room, _ = SitEnv(bundle, randomization=PLAIN).reset(seed=1, options=face)
    assert 0.02 < (with_chair["head"] != room["head"]).any(axis=2).mean() < 0.6
    told = run(env, [SIT_DOWN] * 120, seed=1, options=before(seat))
    assert told[-1][-1]["is_success"], told[-1][-1]


def test_friction_and_masses_are_drawn_and_are_the_models_own_again(bundle, walk):
    model = walk._episode.composition.model
    seen = set()
    for seed in (1, 2, 1):
        walk.reset(seed=seed)
        seen.add((float(model.geom_friction[0, 0]), float(model.body_mass.sum())))
    assert len(seen) == 2
    compiled = WalkEnv(bundle, randomization=PLAIN)
    compiled.reset(seed=1)
    plain = compiled._episode.composition.model
    ratios = model.body_mass[plain.body_mass > 0.0] / plain.body_mass[plain.body_mass > 0.0]
    assert np.ptp(ratios) < 1e-12 and 0.95 <= ratios[0] <= 1.05 and ratios[0] != 1.0


@pytest.mark.parametrize("wrong", [{"chairs": ("throne",)}, {"render_mode": "human"}])
def test_what_there_is_not_is_told(bundle, wrong):
    with pytest.raises(SettingsError):
        WalkEnv(bundle, **wrong)


def test_a_bundle_without_a_result_and_a_start_that_is_none_are_told(bundle, walk, tmp_path):
    with pytest.raises(R2SEgoError):
        WalkEnv(tmp_path / "none.r2s")
    for start in ((1.0, 2.0), (np.nan, 0.0, 0.0)):
        with pytest.raises(SettingsError):
            walk.reset(options={"start": start})


@pytest.mark.parametrize("action", [np.zeros(3), np.zeros(5), np.zeros((1, 4)), 0.3, [0.0, np.nan, 0.0, 0.0]])
def test_an_action_that_is_none_changes_nothing(walk, action):
    walk.reset(seed=3)
    walk.step(AHEAD)
    before = walk.observed()["proprio"]
    with pytest.raises(RobotError):
        walk.step(action)
    np.testing.assert_array_equal(walk.observed()["proprio"], before)


LIGHT = """
import sys
import r2sego_blender.policy.environment.environments
assert "torch" not in sys.modules
import gymnasium
assert {"r2sego/Sit-v0", "r2sego/Walk-v0"} <= set(gymnasium.registry)
"""
WITHOUT = """
import sys
sys.modules["gymnasium"] = None
import r2sego_blender.policy
"""


@pytest.mark.parametrize("program", [LIGHT, WITHOUT])
def test_an_environment_needs_no_torch_and_the_room_no_gymnasium(program):
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=Path(__file__).parents[3], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
