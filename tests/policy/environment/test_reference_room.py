"""A reference room: the same starts as in training, on true geometry and in its own light, with other dynamics."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from training_room import SEAT_HEIGHT_M

from r2sego_blender.core.errors import GeometryError, SceneError
from r2sego_blender.core.images import to_uint8
from r2sego_blender.geometry.texture.surface_light_field import SurfaceLightField
from r2sego_blender.policy.environment.environments import SitEnv, WalkEnv
from r2sego_blender.policy.environment.randomization import Randomization
from r2sego_blender.policy.environment.reference_room import REFERENCE_RANDOMIZATION, ReferenceRoom
from r2sego_blender.policy.environment.starts import Start, draw_start
from r2sego_blender.robot.behaviours.trajectory import STAND_OFF_M

PLAIN = Randomization.none()
SIT_DOWN = np.float32([0, 0, 0, 1])
RAISED_M = 0.06


@pytest.fixture(scope="module")
def trained(bundle) -> SitEnv:
    return SitEnv(bundle, randomization=PLAIN)


@pytest.fixture(scope="module")
def on_higher(bundle, higher) -> SitEnv:
    return SitEnv(bundle, reference=higher, randomization=PLAIN, render_mode="rgbd_tuple")


def test_episodes_begin_where_those_of_the_same_seed_begin_in_training(trained, on_higher):
    for seed in range(4):
        there, here = (env.reset(seed=seed)[1]["state"] for env in (trained, on_higher))
        np.testing.assert_array_equal(here.base_xy_m, there.base_xy_m)
        assert here.yaw_rad == there.yaw_rad
        assert np.linalg.norm(np.subtract(here.seat.edge_m, there.seat.edge_m)) < 0.05
        assert here.seat.yaw_rad == pytest.approx(there.seat.yaw_rad, abs=0.1)
        assert here.seat.height_m - there.seat.height_m == pytest.approx(RAISED_M, abs=1e-3)


def test_who_sits_down_sits_on_the_true_seat(trained, on_higher):
    heights_m = []
    for env in (trained, on_higher):
        seat = env.scene.seats[0]
        env.reset(seed=0, options={"start": (*seat.ahead(STAND_OFF_M), seat.yaw_rad)})
        for _ in range(120):
            *_, terminated, truncated, info = env.step(SIT_DOWN)
            if terminated or truncated:
                break
        assert info["is_success"], info["detail"]
        heights_m.append(info["state"].base_height_m)
    assert heights_m[1] - heights_m[0] == pytest.approx(RAISED_M, abs=0.02) and heights_m[0] > SEAT_HEIGHT_M


def test_the_head_sees_the_reference_rooms_light_and_true_depth(on_higher, higher):
    observation, _ = on_higher.reset(seed=3)
    colour, depth_m = on_higher.render()
    robot = on_higher.scene.robot
    pose = robot.camera_poses(on_higher._episode.data.qpos[None])[0]
    expected, expected_m = SurfaceLightField.load(higher / "light.npz").render(robot.mount.camera(128, 96).at(pose))
    np.testing.assert_array_equal(observation["head"], to_uint8(expected))
    np.testing.assert_array_equal(colour, observation["head"])
    np.testing.assert_array_equal(depth_m, expected_m)
    assert colour.std() > 5.0 and (depth_m > 0.0).all()


def test_pictures_are_drawn_as_in_training_and_dynamics_are_not(bundle, reference):
    there, here = WalkEnv(bundle), WalkEnv(bundle, reference=reference)
    for seed in range(6):
        for env in (there, here):
            env.reset(seed=seed)
        np.testing.assert_array_equal(there._drawn.view.parent_from_camera, here._drawn.view.parent_from_camera)
        assert (
            there._drawn.view.gains == here._drawn.view.gains and there._drawn.view.lens.fx == here._drawn.view.lens.fx
        )
        assert 0.1 <= here._drawn.latency_s <= 0.2 and here._drawn.latency_s > there._drawn.latency_s
        assert 0.5 <= here._drawn.friction <= 0.9 and here._drawn.friction < there._drawn.friction
        assert 1.05 <= here._drawn.mass <= 1.1 and here._drawn.mass > there._drawn.mass
    trained = Randomization()
    assert trained != REFERENCE_RANDOMIZATION
    assert REFERENCE_RANDOMIZATION.mass[0] >= trained.mass[1]
    assert REFERENCE_RANDOMIZATION.latency_s[1] > trained.latency_s[1]
    assert REFERENCE_RANDOMIZATION.friction[0] < trained.friction[0]


def test_a_place_that_is_not_free_in_truth_gives_way_to_the_nearest_that_is(trained, reference):
    room = ReferenceRoom.open(reference, trained.scene)
    floor, seat = room.scene.floor, trained.scene.seats[0]
    inside = np.array(seat.ahead(-0.1))
    assert not floor.is_free(inside)
    moved = room.start(Start(inside, 0.3, trained.scene.floor, seat, goal_m=inside))
    free = floor.points(*np.nonzero(floor.free))
    nearest_m = np.linalg.norm(free - inside, axis=1).min()
    for place in (moved.place_m, moved.goal_m):
        assert floor.is_free(place) and np.linalg.norm(place - inside) == pytest.approx(nearest_m)
    assert moved.heading_rad == 0.3 and moved.floor is floor


def test_a_separate_chair_stands_where_it_stands_in_training(trained, reference):
    room = ReferenceRoom.open(reference, trained.scene)
    start = draw_start(trained.scene, True, ("stool",), np.random.default_rng(2))
    moved = room.start(start)
    assert moved.chair is start.chair and moved.seat is start.seat
    assert not moved.floor.is_free(start.chair.world_from_chair[:2, 3])


def test_a_folder_that_is_none_and_a_damaged_light_field_are_told(trained, reference, tmp_path):
    with pytest.raises(SceneError):
        ReferenceRoom.open(tmp_path, trained.scene)
    damaged = shutil.copytree(reference, tmp_path / "damaged")
    (damaged / "light.npz").write_bytes((reference / "light.npz").read_bytes()[:-200])
    with pytest.raises(GeometryError):
        ReferenceRoom.open(damaged, trained.scene)


def test_the_same_seed_is_the_same_episode_to_the_bit(bundle, reference):
    told = []
    for _ in range(2):
        env = SitEnv(bundle, reference=reference, max_seconds=0.3)
        told.append([env.reset(seed=9)[0], *(env.step(np.float32([0.5, 0, 0.5, -1]))[0] for _ in range(2))])
    for one, other in zip(*told, strict=True):
        for key, values in one.items():
            np.testing.assert_array_equal(values, other[key])
