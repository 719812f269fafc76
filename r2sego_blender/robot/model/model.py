"""The robot embodiment: any MJCF or URDF with a free base, legs or wheels, and a camera mount."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ...core.cameras import Camera
from ...core.errors import RobotError
from .collision_shapes import colliding, core_points, highest_m, lowest_m, reach_m
from .humanoid import SERVOS, Servo
from .model_camera import eyes, mount_of
from .mount import CameraMount, mount_on
from .rest_posture import declared_posture, standing_posture
from .robot_file import EMBEDDED_HUMANOID, compiled_robot
from .structure import (
    Leg,
    Wheel,
    ancestors,
    axes_in_base,
    find_legs,
    find_shoulders,
    find_wheels,
    first_about,
    fixed_to,
    is_hinge,
    joints_of,
    no_wheels,
    on_joints,
    posed,
    standing_leg,
)

# Gains and bounds belong to a robot of this mass; other robots' scale with theirs.
_SERVO_ROBOT_MASS_KG = 35.0
# Casters and skids of a wheeled robot come this close to the floor at rest.
_RESTS_M = 0.01
# What must be finite in a compiled robot, and no more than this: the XML's own numbers are finite, but not all
# that follows. A robot reaches no kilometre, whose squares and sums would lose what is small.
_FAR, _MUCH = 1e3, 1e15
_TABLES = {
    "qpos0": _FAR,
    "key_qpos": _FAR,
    "body_pos": _FAR,
    "body_quat": 2.0,
    "body_mass": _MUCH,
    "body_inertia": _MUCH,
    "jnt_pos": _FAR,
    "jnt_axis": 2.0,
    "jnt_range": _MUCH,
    "dof_armature": _MUCH,
    "dof_damping": _MUCH,
    "geom_pos": _FAR,
    "geom_size": _FAR,
    "cam_pos": _FAR,
    "mesh_vert": _FAR,
}
_TOLD_HINGES = 4
# No robot of a room is larger; one in millimetres or centimetres is.
_LARGEST_M = 20.0
_FREE, _BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)


@dataclass(frozen=True)
class RobotModel:
    """A compiled robot and what its structure says about it.

    Ids are MuJoCo's, into ``model``. ``rest_qpos`` (nq,) float64 is the standing posture
    with the base's origin over the world's and the lowest point on z = 0. ``radius_m`` is the
    reach of the robot's collision shapes and its camera around the base's vertical axis and
    ``height_m`` their top, at rest. A robot without legs has two wheels at least.
    """

    source: str
    model: mujoco.MjModel
    mount: CameraMount
    base: int
    legs: tuple[Leg, ...]  # front to back, left before right
    wheels: tuple[Wheel, ...]  # left to right
    waist_yaw: int | None  # about the base's z at rest
    waist_pitch: int | None  # about the base's y at rest
    shoulders: tuple[int, ...]  # the joints that swing the arms, left then right
    rest_qpos: np.ndarray
    radius_m: float
    height_m: float
    bounded_links: tuple[str, ...] = ()  # whose masses or inertias a URDF does not give as a body's

    @staticmethod
    def load(
        source: str | Path = EMBEDDED_HUMANOID,
        mount: str | Sequence[Any] | Mapping[str, Any] | CameraMount | None = None,
    ) -> RobotModel:
        """Load the embedded humanoid or an MJCF/URDF file.

        ``mount`` is the name of a camera in the file, ``[parent, xyz, rpy, fov]`` (see
        ``mount.parse_mount``), or None for the file's only camera or the one named
        ``head_camera``; cameras that follow or aim at something are none. Raises RobotError:
        a file that does not compile (with MuJoCo's words), no free base, a ball joint, a size of
        more than 20 m, neither two legs nor two driven wheels, an unknown camera or parent, a
        camera without perspective.
        """
        source = str(source)
        model, bounded_links = compiled_robot(source)
        _refuse_wild_numbers(model, source)
        base = _free_base(model, source)
        _refuse_balls(model, source)
        geoms = colliding(model)
        if not len(geoms):
            raise RobotError(
                "the robot has no shape that can touch anything", where=source, cure="Give it collision shapes."
            )
        declared = declared_posture(model)
        _refuse_other_units(model, base, declared, geoms, source)
        camera_mount = _find_mount(model, base, mount, source)
        wheels = find_wheels(model, base, declared)
        # Arms of a wheeled robot hang lowest of all its limbs, and are no legs.
        legs = () if len(wheels) >= 2 else find_legs(model, base, declared)
        if len(wheels) < 2 and len(legs) < 2:
            raise _cannot_move(source, len(legs), len(wheels), no_wheels(model, base, declared))
        in_legs = {joint for leg in legs for joint in leg.joints}
        waist = [
            joint
            for body in ancestors(model, model.body(camera_mount.parent).id)
            for joint in joints_of(model, body)
            if is_hinge(model, joint) and joint not in in_legs
        ]
        rolling = {wheel.joint for wheel in wheels}
        rest = standing_posture(model, base, legs, declared)
        legs = tuple(standing_leg(model, base, leg, rest) for leg in legs)
        data = posed(model, rest)
        axes = axes_in_base(data, base)  # links' own frames are turned as it pleased who wrote the file
        robot = RobotModel(
            source=source,
            model=model,
            mount=camera_mount,
            base=base,
            legs=legs,
            wheels=wheels,
            waist_yaw=first_about(axes, waist, 2),
            waist_pitch=first_about(axes, waist, 1),
            shoulders=find_shoulders(model, in_legs | rolling | set(waist)),
            rest_qpos=rest,
            radius_m=reach_m(model, data, geoms, data.xpos[base, :2]),
            height_m=highest_m(model, data, geoms),
            bounded_links=bounded_links,
        )
        # A camera on a mast without a shape is not to go through what is over the others.
        eye_reach_m = float(np.linalg.norm(robot.camera_poses(rest[None])[0, :2, 3] - data.xpos[base, :2]))
        robot = replace(
            robot, radius_m=max(robot.radius_m, eye_reach_m), height_m=max(robot.height_m, robot.eye_height_m)
        )
        if not max(robot.radius_m, robot.height_m) <= _FAR:
            raise RobotError("the robot or its camera reaches a kilometre", where=source, cure="Give metres.")
        return robot

    @property
    def is_wheeled(self) -> bool:
        """Whether it rolls rather than walks."""
        return not self.legs

    @property
    def ground_bodies(self) -> tuple[int, ...]:
        """The bodies that stand or roll on the floor: feet, wheels, and casters."""
        model = self.model
        found = {body for leg in self.legs for body in leg.foot_bodies}
        for wheel in self.wheels:
            found |= {*fixed_to(model, int(model.jnt_bodyid[wheel.joint]))}
        if self.is_wheeled:
            data = posed(model, self.rest_qpos)
            for geom in colliding(model):
                if lowest_m(model, data, np.array([geom])) < _RESTS_M:
                    found.add(int(model.geom_bodyid[geom]))
        return tuple(sorted(found))

    @property
    def skid_geoms(self) -> tuple[int, ...]:
        """What of a rolling robot's base rests on the floor: fixed casters and skids."""
        if not self.is_wheeled:
            return ()
        model, data = self.model, posed(self.model, self.rest_qpos)
        ours = [geom for geom in colliding(model) if model.geom_bodyid[geom] in fixed_to(model, self.base)]
        return tuple(int(geom) for geom in ours if lowest_m(model, data, np.array([geom])) < _RESTS_M)

    @property
    def foot_offsets_m(self) -> np.ndarray:
        """(L, 2) x and y of the feet's tips in the base's frame at rest."""
        data = posed(self.model, self.rest_qpos)
        places = np.array([leg.tip_place(data) for leg in self.legs]).reshape(-1, 3)
        return places[:, :2] - data.xpos[self.base, :2]

    @property
    def leg_m(self) -> float:
        """From the root of a leg to its foot at rest; the shortest of all."""
        data = posed(self.model, self.rest_qpos)
        return min(math.dist(data.xanchor[leg.joints[0]], leg.tip_place(data)) for leg in self.legs)

    @property
    def rest_height_m(self) -> float:
        """Height of the base above the floor in the standing posture."""
        return float(self.rest_qpos[2])

    @property
    def mass_scale(self) -> float:
        """Its mass over that of the robot whose gains and bounds the library states."""
        return float(self.model.body_mass.sum()) / _SERVO_ROBOT_MASS_KG

    @property
    def half_width_m(self) -> float:
        """How far the standing robot reaches to either side."""
        data = posed(self.model, self.rest_qpos)
        shapes = [core_points(self.model, data, geom) for geom in colliding(self.model)]
        aside = [np.abs(points[:, 1] - data.xpos[self.base, 1]).max() + round_m for points, round_m in shapes]
        return float(max(aside))

    @property
    def eye_height_m(self) -> float:
        """Height of the head camera above the floor in the standing posture."""
        return float(self.camera_poses(self.rest_qpos[None])[0, 2, 3])

    def camera_poses(self, qpos: np.ndarray, mount: CameraMount | None = None) -> np.ndarray:
        """``world_from_camera`` (T, 4, 4) float64 of configurations ``qpos`` (T, nq).

        Forward kinematics and the mount, the paper's Eq. 2; ``mount`` replaces the robot's.
        """
        mount = mount or self.mount
        parent = self.model.body(mount.parent).id
        data = mujoco.MjData(self.model)
        poses = np.tile(np.eye(4), (len(qpos), 1, 1))
        for pose, configuration in zip(poses, np.asarray(qpos, np.float64), strict=True):
            data.qpos[:] = configuration
            mujoco.mj_kinematics(self.model, data)
            pose[:3, :3] = data.xmat[parent].reshape(3, 3)
            pose[:3, 3] = data.xpos[parent]
        return poses @ mount.parent_from_camera

    def camera(self, width: int, height: int) -> Camera:
        """The mount's lens at the resting robot's pose."""
        return self.mount.camera(width, height).at(self.camera_poses(self.rest_qpos[None])[0])

    def servos(self) -> dict[str, Servo]:
        """Gains of each hinge or slide joint: the file's own position servos, else by place.

        Gains by place (hip, knee, ankle, waist, arm) are the embedded humanoid's, scaled by
        this robot's mass.
        """
        model = self.model
        scale = self.mass_scale
        on_leg = {j for leg in self.legs for j in leg.joints}
        camera_chain = set(ancestors(model, model.body(self.mount.parent).id))
        servos = {}
        for joint in range(model.njnt):
            if model.jnt_type[joint] == _FREE:
                continue
            name = model.joint(joint).name
            if joint in on_leg:
                place = next((place for place in ("knee", "ankle") if place in name), "hip")
            else:
                place = "waist" if model.jnt_bodyid[joint] in camera_chain else "arm"
            gains = SERVOS[place]
            servos[name] = Servo(gains.stiffness * scale, gains.damping * scale)
        for actuator in np.flatnonzero(on_joints(model)):
            stiffness, damping = model.actuator_gainprm[actuator, 0], -model.actuator_biasprm[actuator, 2]
            if model.actuator_biasprm[actuator, 1] == -stiffness and stiffness > 0.0:
                name = model.joint(model.actuator_trnid[actuator, 0]).name
                # The gear stretches the angle that it is told of, and then the force.
                gear = model.actuator_gear[actuator, 0] ** 2
                servos[name] = Servo(float(gear * stiffness), float(gear * damping))
        return servos


def _free_base(model: mujoco.MjModel, source: str) -> int:
    free = np.flatnonzero(model.jnt_type == _FREE)
    if len(free) != 1 or model.jnt_qposadr[free[0]] != 0:
        raise RobotError(
            f"the robot has {len(free)} free bodies",
            where=source,
            cure="Give one robot whose first body has the only free joint.",
        )
    return int(model.jnt_bodyid[free[0]])


def _refuse_wild_numbers(model: mujoco.MjModel, source: str) -> None:
    for table, most in _TABLES.items():
        values = getattr(model, table)
        if not np.isfinite(values).all():
            raise RobotError(f"{table} is not finite", where=source, cure="Correct the file.")
        if np.abs(values).max(initial=0.0) > most:
            raise RobotError(f"{table} is beyond {most:g}", where=source, cure="Give metres, kilograms, radians.")


def _cannot_move(source: str, legs: int, wheels: int, no_wheels: Mapping[str, str]) -> RobotError:
    """For so many legs and wheels; ``no_wheels`` says of hinges by their names why they are none."""
    why = "".join(f"; '{name}' is no wheel: {reason}" for name, reason in islice(no_wheels.items(), _TOLD_HINGES))
    return RobotError(
        f"the robot has {legs} legs and {wheels} driven wheels{why}",
        where=source,
        cure="Give one with two legs of three hinges or more, or with two driven wheels, endless hinges "
        "with a cylinder, a sphere or a round mesh.",
    )


def _refuse_balls(model: mujoco.MjModel, source: str) -> None:
    """A servo drives one coordinate, and a ball joint's four are no angles."""
    balls = [model.joint(joint).name for joint in np.flatnonzero(model.jnt_type == _BALL)]
    if balls:
        raise RobotError(
            f"'{balls[0]}' is a ball joint, which no servo can drive",
            where=source,
            cure="Replace it by three hinges, or leave it out: what it holds is then fixed.",
        )


def _refuse_other_units(model: mujoco.MjModel, base: int, posture: np.ndarray, geoms: np.ndarray, source: str) -> None:
    """What is as large as a house was written in millimetres, and nothing else of it need be told."""
    data = posed(model, posture)
    height_m = highest_m(model, data, geoms) - lowest_m(model, data, geoms)
    size_m = max(height_m, reach_m(model, data, geoms, data.xpos[base, :2]))
    if not size_m <= _LARGEST_M:
        raise RobotError(
            f"the robot is {size_m:.0f} m large",
            where=source,
            cure='Is it in millimetres? Write metres, or give its meshes scale="0.001 0.001 0.001".',
        )


def _find_mount(model: mujoco.MjModel, base: int, mount: Any, source: str) -> CameraMount:
    names = eyes(model)
    if mount is None:
        mount = names[0] if len(names) == 1 else "head_camera"
        if mount not in names:
            raise RobotError(
                "the robot's file does not say which camera is its eye",
                where=source,
                cure=_about_eyes(names, model.body(base).name),
            )
    if isinstance(mount, str):
        if mount not in names:
            watches = mount in (model.camera(index).name for index in range(model.ncam))
            what = f"'{mount}' watches the robot and is no eye" if watches else f"the robot has no camera '{mount}'"
            known = f"It has: {', '.join(names)}." if names else "It has no eye; give [parent, xyz, rpy, fov]."
            raise RobotError(what, where=source, cure=known)
        return mount_of(model, model.camera(mount).id, source)
    bodies = [model.body(index).name for index in range(1, model.nbody)]
    return mount_on(bodies, mount, source)


def _about_eyes(names: list[str], base: str) -> str:
    """How to give a robot its eye: by the name of one of its cameras, else by a place on its base."""
    form, what = json.dumps(names[0] if names else base, ensure_ascii=False), "Name one"
    if not names:
        form, what = f"[{form}, [0.05, 0, 0.4], [0, 0.4, 0], {{hfov_deg = 69}}]", "Place one, in metres and radians"
    option = shlex.quote(f"robot.mount={form}")
    known = f" It has: {', '.join(names)}." if names else ""
    return f"{what}, in the same call: `r2sego robot SCENE --robot FILE --set {option}`.{known}"
