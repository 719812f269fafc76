"""The embedded wheeled base: believable, standing, driven by two wheels, its camera on the mast."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from r2sego_blender.robot.model.structure import posed
from r2sego_blender.robot.model.wheeled_base import CAMERA_HEIGHT_M, TRACK_M, WHEEL_RADIUS_M, wheeled_base_mjcf


@pytest.fixture(scope="module")
def on_floor() -> mujoco.MjModel:
    """The base on a plane, alone."""
    spec = mujoco.MjSpec.from_string(wheeled_base_mjcf())
    floor = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(5, 5, 0.1))
    floor.contype, floor.conaffinity = 0, 1
    return spec.compile()


def drive(model: mujoco.MjModel, left_rad_s: float, right_rad_s: float, seconds: float) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    lead_s = -model.actuator_biasprm[:, 2] / model.actuator_gainprm[:, 0]  # what the damping lags behind
    rates, angles = np.array([left_rad_s, right_rad_s]), np.zeros(2)
    for _ in range(round(seconds / model.opt.timestep)):
        eased = min(1.0, data.time) * rates
        angles += eased * model.opt.timestep
        data.ctrl[:] = angles + lead_s * eased
        mujoco.mj_step(model, data)
    return data


def test_masses_and_inertias_are_believable(wheeled):
    model = wheeled.model
    assert 20.0 < model.body_mass.sum() < 30.0
    data = posed(model, wheeled.rest_qpos)
    mujoco.mj_comPos(model, data)
    middle = data.subtree_com[wheeled.base]
    assert np.abs(middle[:2] - data.xpos[wheeled.base, :2]).max() < 0.02  # between the casters, on the axle
    assert middle[2] < 0.35 * wheeled.height_m
    assert 0.2 < wheeled.radius_m < 0.25
    assert wheeled.height_m == pytest.approx(CAMERA_HEIGHT_M + 0.03, abs=0.01)


def test_structure(wheeled):
    assert wheeled.is_wheeled
    assert wheeled.legs == ()
    assert [wheel.radius_m for wheel in wheeled.wheels] == pytest.approx([WHEEL_RADIUS_M] * 2, rel=0.01)
    offsets = np.array([wheel.offset_m for wheel in wheeled.wheels])
    np.testing.assert_allclose(offsets, [[0.0, TRACK_M / 2.0], [0.0, -TRACK_M / 2.0]])
    assert [wheel.forward for wheel in wheeled.wheels] == [1.0, 1.0]
    names = {wheeled.model.body(body).name for body in wheeled.ground_bodies}
    assert names == {"base", "left_wheel", "right_wheel"}


def test_camera_looks_ahead_from_the_mast(wheeled):
    camera = wheeled.camera(640, 480)
    assert wheeled.eye_height_m == pytest.approx(CAMERA_HEIGHT_M, abs=1e-6)
    assert camera.forward[0] > 0.9
    assert camera.forward[1] == pytest.approx(0.0, abs=1e-9)
    assert math.degrees(math.asin(-camera.forward[2])) == pytest.approx(20.0, abs=0.1)
    assert camera.fx == pytest.approx(320.0 / math.tan(math.radians(34.5)), rel=1e-6)


def test_stands_still(on_floor):
    data = drive(on_floor, 0.0, 0.0, 3.0)
    np.testing.assert_allclose(data.qpos[:3], (0.0, 0.0, WHEEL_RADIUS_M), atol=3e-3)
    assert data.qpos[3] > 0.99999


def test_rolls_as_far_as_its_wheels_turn(on_floor):
    data = drive(on_floor, 4.0, 4.0, 4.0)
    turned = data.qpos[7:9]
    assert turned.min() > 8.0
    assert data.qpos[0] == pytest.approx(WHEEL_RADIUS_M * turned.mean(), rel=0.02)
    assert abs(data.qpos[1]) < 0.02
    assert data.qpos[3] > 0.999


def test_turns_on_the_spot(on_floor):
    data = drive(on_floor, -2.0, 2.0, 3.0)
    yaw = 2.0 * math.atan2(data.qpos[6], data.qpos[3])
    rolled_m = WHEEL_RADIUS_M * (data.qpos[8] - data.qpos[7])
    assert yaw == pytest.approx(rolled_m / TRACK_M, rel=0.1)  # tyres slip a little in turning
    assert np.linalg.norm(data.qpos[:2]) < 0.02
