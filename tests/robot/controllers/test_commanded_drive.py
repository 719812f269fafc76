"""The drive that is commanded as it goes on: upright whatever is asked, and seated by what carries it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import pytest

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.behaviours.trajectory import STAND_OFF_M, Seat
from r2sego_blender.robot.controllers.commanded_drive import CommandedDrive, DriveCommand, DriveLimits
from r2sego_blender.robot.model.composition import compose
from r2sego_blender.robot.model.contacts import scene_contacts
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.rollouts.quality import Meter

STEP_S, TICK_S = 0.002, 0.02
SIT, STAND = DriveCommand(sit=True), DriveCommand()
G1 = "g1/unitree_mujoco_g1/g1_29dof.xml"
G1_MOUNT = ["torso_link", [0.0576235, 0.01753, 0.42987], [0.0, 0.8307767, 0.0], {"hfov_deg": 69.0}]
# No foot of the planner's rollouts in rooms slides farther.
SLIDE_M = 0.01


class Run:
    """A robot on a wide floor with ``boxes`` (x, y, half x, half y, height), and what it did each tick."""

    def __init__(
        self, robot: RobotModel, folder: Path, boxes: Sequence[Sequence[float]] = (), seat: Seat | None = None
    ):
        geoms = '<geom type="box" pos="0 0 -0.05" size="30 30 0.05"/>' + "".join(
            f'<geom type="box" pos="{x} {y} {h / 2}" size="{hx} {hy} {h / 2}"/>' for x, y, hx, hy, h in boxes
        )
        scene = folder / "scene.xml"
        scene.write_text(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")
        self.composition = compose(robot, scene, RolloutSettings(), step_s=STEP_S)
        self.drive, self.seat = CommandedDrive(robot, self.composition, 0.0), seat
        self.start(0.0)

    def start(self, heading_rad: float) -> None:
        self.data, self.step = mujoco.MjData(self.composition.model), 0
        self.data.qpos[:] = self.drive.start(np.zeros(2), heading_rad)
        self.meter = Meter(self.composition, self.seat, TICK_S)
        self.base, self.reference = [self.data.qpos[:7].copy()], [self.data.qpos[:7].copy()]

    def go(self, command: DriveCommand, seconds: float) -> Run:
        self.drive.command(command)
        for _ in range(round(seconds / TICK_S)):
            for _ in range(round(TICK_S / STEP_S)):
                self.drive.apply(self.data, self.step)
                mujoco.mj_step(self.composition.model, self.data)
                self.step += 1
            self.meter.read(self.data, scene_contacts(self.composition, self.data))
            self.base.append(self.data.qpos[:7].copy())
            self.reference.append(np.concatenate([self.data.mocap_pos[0], self.data.mocap_quat[0]]))
        return self

    def velocity(self, seconds: float) -> np.ndarray:
        """(3,) ahead, to the left and of the heading, the mean over the last ``seconds``."""
        base = np.array(self.base)[-round(seconds / TICK_S) - 1 :]
        heading = np.unwrap(2.0 * np.arctan2(base[:, 6], base[:, 3]))
        moved, at = np.diff(base[:, :2], axis=0) / TICK_S, 0.5 * (heading[1:] + heading[:-1])
        cos, sin = np.cos(at), np.sin(at)
        ahead, aside = cos * moved[:, 0] + sin * moved[:, 1], cos * moved[:, 1] - sin * moved[:, 0]
        return np.array([ahead.mean(), aside.mean(), (heading[-1] - heading[0]) / seconds])

    @property
    def most_tilted_deg(self) -> float:
        x, y = np.array(self.base)[:, 4:6].T
        return math.degrees(float(np.arccos(1.0 - 2.0 * (x**2 + y**2)).max()))


@pytest.fixture(scope="module")
def open_floor(humanoid, tmp_path_factory) -> Run:
    return Run(humanoid, tmp_path_factory.mktemp("floor"))


def before_a_seat(robot: RobotModel, folder: Path, height_m: float, away_m: float = 0.0) -> Run:
    """With its back to a box, at the planner's stand-off or farther ``away_m``."""
    edge_m = -STAND_OFF_M - away_m
    seat = Seat(edge_m=(edge_m, 0.0), height_m=height_m, yaw_rad=0.0, approach_m=1.0)
    return Run(robot, folder, [(edge_m - 0.25, 0.0, 0.25, 0.3, height_m)], seat)


@pytest.mark.parametrize("seed", range(3))
def test_whatever_is_commanded_it_stays_upright(open_floor, seed):
    rng = np.random.default_rng(seed)
    open_floor.start(rng.uniform(-3.0, 3.0))
    asked, done = [], []
    while open_floor.step * STEP_S < 20.0:
        limits = open_floor.drive.limits
        ranges = np.array([limits.vx_m_s, limits.vy_m_s, limits.yaw_rate_rad_s])
        velocity = rng.uniform(*(1.4 * ranges.T)) * (rng.random(3) < 0.75)
        seconds = float(rng.choice([0.1, 0.3, 1.0, 3.0]))
        open_floor.go(DriveCommand(*velocity), seconds)
        if seconds > 2.0:
            asked.append(np.clip(velocity, *ranges.T))
            done.append(open_floor.velocity(1.0))  # two steps: the base sways once
    assert open_floor.most_tilted_deg < 3.0
    assert open_floor.meter.foot_slide_m < SLIDE_M
    assert open_floor.meter.penetration_m < 0.005
    assert (np.abs(np.subtract(done, asked)).mean(axis=0) < 0.1 * np.abs(asked).mean(axis=0)).all()


def test_it_turns_on_the_spot(open_floor):
    open_floor.start(1.0)
    open_floor.go(DriveCommand(yaw_rate_rad_s=0.8), 5.0)
    assert open_floor.velocity(2.0)[2] == pytest.approx(0.8, rel=0.02)
    assert np.linalg.norm(np.array(open_floor.base)[:, :2], axis=1).max() < 0.05


def test_a_reversal_is_no_jump(open_floor):
    """The reference keeps the drive's accelerations, but for the sway of a step."""
    open_floor.start(0.0)
    open_floor.go(DriveCommand(vx_m_s=0.6), 3.0).go(DriveCommand(vx_m_s=-0.3), 3.0)
    assert open_floor.velocity(1.0)[0] == pytest.approx(-0.3, rel=0.05)
    ahead_m = np.array(open_floor.reference)[:, 0]
    acceleration = np.diff(ahead_m, n=2) / TICK_S**2
    assert np.abs(acceleration).max() < DriveLimits().acceleration_m_s2 + 1e-6
    real = np.convolve(np.diff(np.array(open_floor.base)[:, 0], n=2) / TICK_S**2, np.full(10, 0.1), "valid")
    assert np.abs(real).max() < 1.5 * DriveLimits().acceleration_m_s2


def test_a_wall_holds_the_reference_too(humanoid, tmp_path):
    run = Run(humanoid, tmp_path, [(0.9, 0.0, 0.1, 2.0, 1.5)])
    run.go(DriveCommand(vx_m_s=0.6), 6.0)
    apart_m = np.linalg.norm(np.array(run.reference)[:, :2] - np.array(run.base)[:, :2], axis=1)
    assert apart_m.max() < 0.2
    assert np.array(run.base)[-1, 0] < 0.8
    run.go(DriveCommand(vx_m_s=-0.3), 3.0)
    assert run.velocity(1.0)[0] == pytest.approx(-0.3, rel=0.1)
    assert run.most_tilted_deg < 10.0


@pytest.mark.parametrize("height_m", [0.3, 0.42, 0.55])
def test_it_sits_on_what_carries_it_and_walks_away(humanoid, tmp_path, height_m):
    run = before_a_seat(humanoid, tmp_path, height_m)
    run.go(SIT, 0.6)
    assert run.drive.is_lowering and not run.drive.is_seated
    run.go(SIT, 6.4)
    assert run.drive.is_seated and not run.drive.is_lowering
    assert run.drive.seated_s > 3.0
    assert run.meter.seated_s == pytest.approx(run.drive.seated_s, abs=0.5)
    assert run.drive.mean_assist_n == pytest.approx(np.mean(run.meter._assist_n), rel=0.05)
    assert run.drive.mean_assist_n < 20.0
    wrench_n = run.data.actuator_force[2]
    assert -0.1 * 9.81 * run.composition.robot_mass_kg < wrench_n < 0.0  # it presses, it does not carry
    run.go(STAND, 4.0)
    assert not run.drive.is_seated and run.drive.seated_s == 0.0
    assert run.base[-1][2] > 0.7
    run.go(DriveCommand(vx_m_s=0.5), 3.0)
    assert run.velocity(1.0)[0] == pytest.approx(0.5, rel=0.1)
    assert run.most_tilted_deg < 15.0


def test_sitting_down_too_early_misses_the_seat(humanoid, tmp_path):
    run = before_a_seat(humanoid, tmp_path, 0.42, away_m=0.5)
    for _ in range(16):
        run.go(SIT, 0.5)
        assert not run.drive.is_seated and run.meter.seated_s == 0.0
    run.go(STAND, 5.0).go(DriveCommand(vx_m_s=-0.2), 2.0)
    assert run.velocity(1.0)[0] == pytest.approx(-0.2, rel=0.1)


def test_who_walks_comes_to_a_stand_before_sitting(humanoid, tmp_path):
    run = Run(humanoid, tmp_path)
    run.go(DriveCommand(vx_m_s=0.5), 2.0)
    run.go(DriveCommand(vx_m_s=0.5, sit=True), 4.0)
    feet = [leg.tip_place(run.data)[:2] for leg in run.composition.legs]
    assert np.linalg.norm(feet[0] - feet[1]) < 0.3
    assert run.drive.is_lowering


def test_the_same_commands_give_the_same_bits(humanoid, tmp_path):
    run = before_a_seat(humanoid, tmp_path, 0.42)
    ends = []
    for _ in range(2):
        run.start(0.1)
        run.go(DriveCommand(vx_m_s=0.3, yaw_rate_rad_s=0.2), 1.0).go(DriveCommand(vx_m_s=-0.3), 1.0).go(SIT, 3.0)
        ends.append((run.data.qpos.tobytes(), run.drive.mean_assist_n))
    assert ends[0] == ends[1]


def test_another_legged_robot_walks(quadruped, tmp_path):
    run = Run(quadruped, tmp_path)
    run.go(DriveCommand(vx_m_s=0.3, yaw_rate_rad_s=0.3), 4.0)
    np.testing.assert_allclose(run.velocity(1.0)[[0, 2]], 0.3, rtol=0.1)
    assert run.most_tilted_deg < 5.0


def test_wheels_drive_and_do_not_sit(wheeled, tmp_path):
    run = Run(wheeled, tmp_path)
    run.go(DriveCommand(vx_m_s=0.4, vy_m_s=0.2, yaw_rate_rad_s=0.5), 4.0)
    np.testing.assert_allclose(run.velocity(1.0), (0.4, 0.0, 0.5), rtol=0.1, atol=0.02)
    with pytest.raises(RobotError):
        run.drive.command(SIT)


def test_what_no_drive_can_follow_is_refused(humanoid, open_floor, box_room):
    with pytest.raises(RobotError):
        open_floor.drive.command(DriveCommand(vx_m_s=math.nan))
    with pytest.raises(RobotError):
        CommandedDrive(humanoid, compose(humanoid, box_room(), RolloutSettings(), wrench=False), 0.0)


def test_the_real_robot_walks_and_sits(shared_robot, tmp_path):
    run = before_a_seat(RobotModel.load(shared_robot(G1), G1_MOUNT), tmp_path, 0.42)
    run.go(DriveCommand(vx_m_s=0.3), 2.0).go(DriveCommand(vx_m_s=-0.3), 2.0)
    assert run.velocity(1.0)[0] == pytest.approx(-0.3, rel=0.1)
    assert run.most_tilted_deg < 5.0
    run.start(0.0)
    run.go(SIT, 7.0)
    assert run.drive.is_seated and run.drive.seated_s > 2.0
