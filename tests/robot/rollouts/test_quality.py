"""What a simulation measures of a rollout, and when it is a failure."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.robot.behaviours.trajectory import Seat
from r2sego_blender.robot.controllers.tracking import TrackingController
from r2sego_blender.robot.model.composition import Composition, compose
from r2sego_blender.robot.model.contacts import scene_contacts
from r2sego_blender.robot.model.humanoid import humanoid_mjcf
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.model.mount import CameraMount
from r2sego_blender.robot.model.mujoco_warnings import mujoco_warnings
from r2sego_blender.robot.model.structure import posed
from r2sego_blender.robot.planning.free_floor import free_floor
from r2sego_blender.robot.rollouts.failures import SUCCESS, Judge, Reason
from r2sego_blender.robot.rollouts.quality import Meter
from r2sego_blender.robot.rollouts.simulation import simulate
from r2sego_blender.robot.scope.scope import BehaviourScope

SCOPE = BehaviourScope.load("walk_and_look")


@pytest.fixture(scope="module")
def room(box_room):
    return box_room(((1.2, 0.0, 0.3, 0.3, 0.22),))


@pytest.fixture(scope="module")
def composition(humanoid, room) -> Composition:
    return compose(humanoid, room, RolloutSettings())


@pytest.fixture(scope="module")
def judge(humanoid, room, composition) -> Judge:
    return Judge(composition, free_floor(humanoid, SCOPE, room), SCOPE, humanoid.rest_height_m)


@dataclass
class Pushed:
    """Stands, with its base dragged sideways at a speed."""

    composition: Composition
    qpos: np.ndarray
    mount: CameraMount
    speed_m_s: float
    duration_s: float = 1.5
    behaviour: str = "pushed"
    goal: np.ndarray | None = None
    seat: Seat | None = None

    def apply(self, data: mujoco.MjData, step: int) -> None:
        data.ctrl[6:] = self.qpos[self.composition.qpos_address]
        data.mocap_pos[0] = self.qpos[:3]
        data.mocap_pos[0, 1] += self.speed_m_s * step * self.composition.model.opt.timestep
        data.mocap_quat[0] = self.qpos[3:7]


def test_dragged_feet_slide_and_standing_ones_do_not(humanoid, room):
    """On ice the feet follow the base; the meter sees how far."""
    icy = room.with_name("icy.xml")
    icy.write_text(room.read_text().replace('name="floor"', 'name="floor" priority="1" friction="0.005"'))
    composition = compose(humanoid, icy, RolloutSettings())
    free = replace(SCOPE, failures=replace(SCOPE.failures, slide_m=0.0))
    judge = Judge(composition, free_floor(humanoid, SCOPE, icy), free, humanoid.rest_height_m)
    place = humanoid.rest_qpos.copy()
    dragged = simulate(composition, Pushed(composition, place, humanoid.mount, 0.1), judge, 5.0)
    assert not dragged.reason
    feet = [leg.foot for leg in humanoid.legs]
    first, last = (posed(humanoid.model, qpos).xpos[feet, :2] for qpos in dragged.qpos[[0, -1]])
    moved_m = np.linalg.norm(last - first, axis=1).max()
    assert moved_m > 0.05
    # A foot that is unloaded for a moment begins a new stance.
    assert 0.03 < dragged.meter.foot_slide_m < moved_m + 0.02
    strict = Judge(composition, free_floor(humanoid, SCOPE, icy), SCOPE, humanoid.rest_height_m)
    failed = simulate(composition, Pushed(composition, place, humanoid.mount, 0.1), strict, 5.0)
    assert failed.reason == Reason.FOOT_SLIDE
    rough = compose(humanoid, room, RolloutSettings())
    still = simulate(rough, Pushed(rough, place, humanoid.mount, 0.0), strict, 5.0)
    assert not still.reason
    assert still.meter.foot_slide_m < 0.005


def test_penetration_is_as_deep_as_the_robot_was_put(humanoid, composition, judge):
    data = mujoco.MjData(composition.model)
    for depth_m in (0.004, 0.03):
        data.qpos[:] = humanoid.rest_qpos
        data.qpos[2] -= depth_m
        mujoco.mj_forward(composition.model, data)
        meter = Meter(composition, None, 0.02)
        contacts = scene_contacts(composition, data)
        meter.read(data, contacts)
        assert meter.penetration_m == pytest.approx(depth_m, abs=1e-3)
        reason, _ = judge.state(data, contacts, None, meter)
        assert reason == (Reason.PENETRATION if depth_m > 0.01 else Reason.NONE)


def test_a_seat_may_be_touched_by_who_sits_on_it(humanoid, composition, judge):
    """The same contact of pelvis and box is sitting with a seat there, and a failure without."""
    seat = Seat(edge_m=(1.2, -0.3), height_m=0.44, yaw_rad=-np.pi / 2, approach_m=0.4)
    data = mujoco.MjData(composition.model)
    data.qpos[:] = humanoid.rest_qpos
    data.qpos[:2] = 1.2, 0.0
    # Legs and arms folded up, so that the pelvis alone comes down on the box.
    for side in ("left", "right"):
        for name, angle in (("hip_pitch", -2.4), ("shoulder_pitch", -1.6)):
            data.qpos[composition.model.joint(f"robot/{side}_{name}_joint").qposadr[0]] = angle
    contacts = None
    for height_m in np.arange(0.7, 0.44, -0.002):
        data.qpos[2] = height_m
        mujoco.mj_forward(composition.model, data)
        contacts = scene_contacts(composition, data)
        if contacts.depth_m.max(initial=0.0) > 0.003:
            break
    assert contacts is not None and composition.seat_geoms[contacts.robot].all()
    meter = Meter(composition, seat, 0.02)
    meter.read(data, contacts)
    assert meter.seated_s == pytest.approx(0.02)
    assert judge.state(data, contacts, seat, meter)[0] == Reason.NONE
    reason, detail = judge.state(data, contacts, None, Meter(composition, None, 0.02))
    assert reason == Reason.BODY_CONTACT and "touched box0" in detail
    elsewhere = replace(seat, edge_m=(-1.0, -1.0))
    assert judge.state(data, contacts, elsewhere, meter)[0] == Reason.BODY_CONTACT
    assert judge.end(data, None, seat, meter)[0] == Reason.MISSED_TARGET
    data.qpos[2] += 0.1
    mujoco.mj_forward(composition.model, data)
    meter.read(data, scene_contacts(composition, data))
    assert meter.seated_s == 0.0  # who gets up again begins anew


@pytest.mark.parametrize(
    ("joint", "limit", "beyond", "says"),
    [
        ("left_knee_joint", 2.8798, 0.06, "left_knee_joint by 3.4 degrees"),
        ("left_knee_joint", 2.8798, 0.05, ""),
        ("mast", 0.3, 0.011, "mast by 1.1 cm"),
        ("mast", 0.3, 0.009, ""),
        ("mast", -0.1, -0.011, "mast by 1.1 cm"),
    ],
)
def test_hinges_are_judged_in_degrees_and_slides_in_metres(tmp_path, room, joint, limit, beyond, says):
    mast = '<body><joint name="mast" type="slide" range="-0.1 0.3"/><geom size=".03" mass=".2"/></body>'
    path = tmp_path / "robot.xml"
    path.write_text(humanoid_mjcf().replace('<body name="waist_yaw_link"', f'{mast}<body name="waist_yaw_link"'))
    robot = RobotModel.load(path)
    composition = compose(robot, room, RolloutSettings())
    allowed = replace(SCOPE.failures, body_contact=False, penetration_m=0.0)
    judge = Judge(composition, free_floor(robot, SCOPE, room), replace(SCOPE, failures=allowed), robot.rest_height_m)
    data = mujoco.MjData(composition.model)
    data.qpos[:] = robot.rest_qpos
    data.qpos[composition.model.joint(f"robot/{joint}").qposadr] = limit + beyond
    mujoco.mj_forward(composition.model, data)
    meter = Meter(composition, None, 0.02)
    verdict = judge.state(data, scene_contacts(composition, data), None, meter)
    assert verdict == ((Reason.JOINT_LIMIT, says) if says else SUCCESS)


def test_help_is_measured(humanoid, room, judge, composition):
    """A base that is pulled off its feet needs more help than one that stands."""
    place = humanoid.rest_qpos.copy()
    pulled = place.copy()
    pulled[2] += 0.05
    drives = [Pushed(composition, start, humanoid.mount, 0.0, 0.6) for start in (place, pulled)]
    helped = [simulate(composition, drive, judge, 5.0) for drive in drives]
    assist = [one.meter.quality(humanoid.camera_poses(one.qpos)).assist_n for one in helped]
    assert assist[1] > assist[0] + 20.0
    data, meter = mujoco.MjData(composition.model), Meter(composition, None, 0.02)
    for force_n in ((3.0, 0.0, -4.0), (0.0, 10.0, 0.0)):
        data.actuator_force[:3] = force_n
        meter.read(data, scene_contacts(composition, data))
    assert meter.quality(np.eye(4)[None]).assist_n == pytest.approx(7.5)


def test_camera_ranges_are_those_of_the_poses(humanoid, room, composition, judge):
    controller = TrackingController(humanoid, free_floor(humanoid, SCOPE, room), SCOPE, room, RolloutSettings())
    drive = controller.draw(np.random.default_rng(3))
    done = simulate(controller.composition, drive, judge, 5.0)
    poses = humanoid.camera_poses(done.qpos, drive.mount)
    quality = done.meter.quality(poses)
    assert quality.camera_height_m == (poses[:, 2, 3].min(), poses[:, 2, 3].max())
    forward = poses[:, :3, 2]
    down = np.degrees(np.arctan2(-forward[:, 2], np.linalg.norm(forward[:, :2], axis=1)))
    np.testing.assert_allclose(quality.camera_pitch_deg, (down.min(), down.max()), atol=1e-6)


@dataclass
class Thrown(Pushed):
    """Stands until the speed of its base is no number any more."""

    from_step: int = 150

    def apply(self, data: mujoco.MjData, step: int) -> None:
        super().apply(data, step)
        if step == self.from_step:
            data.qvel[0] = np.inf


def test_a_diverged_simulation_ends_before_it_did(humanoid, composition, judge):
    """MuJoCo puts the robot back at the origin and goes on: none of that is the rollout's."""
    place = humanoid.rest_qpos.copy()
    place[:2] = -0.4, 0.3
    with mujoco_warnings() as heard:  # else MuJoCo leaves a log where the tests run
        thrown = simulate(composition, Thrown(composition, place, humanoid.mount, 0.0), judge, 100.0)
    assert heard
    assert thrown.reason == Reason.NON_FINITE
    assert len(thrown.qpos) == len(thrown.times_s)
    step_s = composition.model.opt.timestep
    assert 150 * step_s - 0.03 < thrown.times_s[-1] <= 150 * step_s
    np.testing.assert_allclose(thrown.qpos[:, :2], np.tile(place[:2], (len(thrown.qpos), 1)), atol=0.02)
