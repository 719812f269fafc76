"""The robot embodiment: any MJCF or URDF with a free base, two feet and a camera mount."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ..cameras import Camera
from ..errors import RobotError
from .humanoid import REST_POSTURE_RAD, SERVOS, Servo, humanoid_mjcf
from .mount import CameraMount, parse_mount

EMBEDDED_HUMANOID = "embedded:humanoid"

# The servo gains above belong to a robot of this mass; other robots' gains scale with theirs.
_SERVO_ROBOT_MASS_KG = 35.0
# MuJoCo's camera looks along -z with y up; OpenCV's along z with y down.
_OPENCV_FLIP = np.diag([1.0, -1.0, -1.0])
_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_MESH, _SPHERE, _CAPSULE = (
    int(kind)
    for kind in (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE)
)


@dataclass(frozen=True)
class Leg:
    """One leg: the foot's body and the joints from the base to it, top first."""

    foot: int
    joints: tuple[int, ...]


@dataclass(frozen=True)
class RobotModel:
    """A compiled robot and what its structure says about it.

    Ids are MuJoCo's, into ``model``. ``rest_qpos`` (nq,) float64 is the standing posture
    with the base's origin over the world's and the soles on z = 0. ``sole_m`` is the
    height of a foot body's origin above its sole; ``radius_m`` the reach of the robot's
    collision shapes around the base's vertical axis and ``height_m`` their top, at rest.
    """

    source: str
    model: mujoco.MjModel
    mount: CameraMount
    base: int
    legs: tuple[Leg, Leg]  # left, right
    waist_yaw: int | None
    waist_pitch: int | None
    shoulders: tuple[int, ...]  # the joints that swing the arms, left then right
    rest_qpos: np.ndarray
    sole_m: float
    radius_m: float
    height_m: float

    @staticmethod
    def load(
        source: str | Path = EMBEDDED_HUMANOID,
        mount: str | Sequence[Any] | Mapping[str, Any] | CameraMount | None = None,
    ) -> RobotModel:
        """Load the embedded humanoid or an MJCF/URDF file.

        ``mount`` is the name of a camera in the file, ``[parent, xyz, rpy, fov]`` (see
        ``mount.parse_mount``), or None for the file's only camera or the one named
        ``head_camera``. Raises RobotError: a file that does not compile (with MuJoCo's words),
        no free base, no two feet, an unknown camera or parent.
        """
        source = str(source)
        spec = robot_spec(source)
        try:
            model = spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise _does_not_compile(source, error) from error
        if not (np.isfinite(model.body_pos).all() and np.isfinite(model.body_mass).all()):
            raise RobotError("positions or masses are not finite", where=source, cure="Correct the file.")
        base = _free_base(model, source)
        camera_mount = _find_mount(model, mount, source)
        legs = _find_legs(model, base, source)
        camera_chain = list(_ancestors(model, model.body(camera_mount.parent).id))
        waist = [j for body in camera_chain for j in _joints_of(model, body) if _is_hinge(model, j)]
        in_legs = {j for leg in legs for j in leg.joints}
        shoulders = _find_shoulders(model, set(waist) | in_legs)
        rest = _rest_qpos(model, base)
        data = mujoco.MjData(model)
        data.qpos[:] = rest
        mujoco.mj_kinematics(model, data)
        lowest, _, _ = _extent(model, data, base, {leg.foot for leg in legs})
        rest[2] -= lowest
        _, top, radius = _extent(model, data, base, None)
        return RobotModel(
            source=source, model=model, mount=camera_mount, base=base, legs=legs,
            waist_yaw=_about(model, waist, 2), waist_pitch=_about(model, waist, 1),
            shoulders=shoulders, rest_qpos=rest,
            sole_m=float(data.xpos[legs[0].foot, 2] - lowest),
            radius_m=float(radius), height_m=float(top - lowest),
        )  # fmt: skip

    @property
    def rest_height_m(self) -> float:
        """Height of the base above the floor in the standing posture."""
        return float(self.rest_qpos[2])

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
        scale = float(model.body_mass.sum()) / _SERVO_ROBOT_MASS_KG
        on_leg = {j for leg in self.legs for j in leg.joints}
        camera_chain = set(_ancestors(model, model.body(self.mount.parent).id))
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
        for actuator in range(model.nu):
            stiffness, damping = model.actuator_gainprm[actuator, 0], -model.actuator_biasprm[actuator, 2]
            is_servo = model.actuator_biasprm[actuator, 1] == -stiffness and stiffness > 0.0
            if is_servo and model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINT:
                name = model.joint(model.actuator_trnid[actuator, 0]).name
                servos[name] = Servo(float(stiffness), float(damping))
        return servos


def robot_spec(source: str) -> mujoco.MjSpec:
    """The robot alone, editable: without the floor, lights and cameras of its file's world.

    A URDF gets a free base. Raises RobotError when the file is missing or not readable.
    """
    if source == EMBEDDED_HUMANOID:
        return mujoco.MjSpec.from_string(humanoid_mjcf())
    path = Path(source)
    if not path.is_file():
        raise RobotError(
            "there is no such robot file", where=path, cure=f"Give an MJCF, a URDF or '{EMBEDDED_HUMANOID}'."
        )
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, mujoco.FatalError) as error:
        raise _does_not_compile(source, error) from error
    for element in [*spec.worldbody.geoms, *spec.worldbody.lights, *spec.worldbody.cameras]:
        spec.delete(element)
    if path.suffix.lower() == ".urdf" and spec.worldbody.bodies:
        spec.compiler.fusestatic = False
        if not any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in spec.joints):
            spec.worldbody.bodies[0].add_freejoint()
    return spec


def _does_not_compile(source: str, error: Exception) -> RobotError:
    words = " ".join(str(error).split()).rstrip(".")
    return RobotError(
        f"the robot does not compile: {words}", where=source, cure="Correct the file or give another robot."
    )


def _free_base(model: mujoco.MjModel, source: str) -> int:
    free = np.flatnonzero(model.jnt_type == _FREE)
    if len(free) != 1 or model.jnt_qposadr[free[0]] != 0:
        raise RobotError(
            f"the robot has {len(free)} free bodies", where=source,
            cure="Give one robot whose first body has the only free joint.",
        )  # fmt: skip
    return int(model.jnt_bodyid[free[0]])


def _find_mount(model: mujoco.MjModel, mount: Any, source: str) -> CameraMount:
    names = [model.camera(index).name for index in range(model.ncam)]
    if mount is None:
        mount = names[0] if len(names) == 1 else "head_camera"
        if mount not in names:
            raise RobotError(
                "the robot's file does not say which camera is its eye", where=source,
                cure="Give the mount: a camera's name, or [parent, xyz, rpy, fov].",
            )  # fmt: skip
    if isinstance(mount, str):
        if mount not in names:
            known = f"It has: {', '.join(names)}." if names else "It has none; give [parent, xyz, rpy, fov]."
            raise RobotError(f"the robot has no camera '{mount}'", where=source, cure=known)
        camera = model.camera(mount)
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.cam_quat[camera.id])
        pose = np.eye(4)
        pose[:3, :3] = rotation.reshape(3, 3) @ _OPENCV_FLIP
        pose[:3, 3] = model.cam_pos[camera.id]
        parent = model.body(model.cam_bodyid[camera.id]).name
        return CameraMount(parent, pose, float(model.cam_fovy[camera.id]), vertical=True)
    if not isinstance(mount, CameraMount):
        mount = parse_mount(mount, source)
    bodies = [model.body(index).name for index in range(1, model.nbody)]
    if mount.parent not in bodies:
        raise RobotError(
            f"the robot has no body '{mount.parent}'", where=source, cure=f"It has: {', '.join(bodies)}."
        )
    return mount


def _find_legs(model: mujoco.MjModel, base: int, source: str) -> tuple[Leg, Leg]:
    """The two chains of hinges whose ends hang lowest below the base at qpos0."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    chains = []
    parents = set(model.body_parentid[1:])
    for body in range(base + 1, model.nbody):
        if body in parents:
            continue
        chain = [b for b in _ancestors(model, body) if b != base]
        joints = [j for b in chain for j in _joints_of(model, b) if _is_hinge(model, j)]
        # The foot is the last body a hinge moves; what is fixed to it belongs to it.
        if len(joints) >= 4:
            foot = int(model.jnt_bodyid[joints[-1]])
            chains.append((data.xpos[foot, 2], foot, tuple(joints)))
    lowest = {foot: Leg(foot, joints) for _, foot, joints in sorted(chains, reverse=True)}
    feet = sorted(lowest, key=lambda foot: data.xpos[foot, 2])[:2]
    if len(feet) < 2 or set(lowest[feet[0]].joints) & set(lowest[feet[1]].joints):
        raise RobotError(
            "the robot has no two legs of four joints or more", where=source, cure="Give a biped."
        )
    left, right = sorted(feet, key=lambda foot: -data.xpos[foot, 1])
    return lowest[left], lowest[right]


def _find_shoulders(model: mujoco.MjModel, others: set[int]) -> tuple[int, ...]:
    """The first sideways hinge of each limb that is neither leg nor waist, left then right."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    found: list[int] = []
    for joint in range(model.njnt):
        moved = set(_ancestors(model, int(model.jnt_bodyid[joint])))
        beyond = any(model.jnt_bodyid[other] in moved for other in found)
        if joint in others or beyond or not _is_hinge(model, joint):
            continue
        if abs(data.xaxis[joint, 1]) > 0.9:
            found.append(joint)
    return tuple(sorted(found[:2], key=lambda joint: -data.xanchor[joint, 1]))


def _rest_qpos(model: mujoco.MjModel, base: int) -> np.ndarray:
    if model.nkey:
        rest = model.key_qpos[0].copy()
    else:
        rest = model.qpos0.copy()
        for name, angle in REST_POSTURE_RAD.items():
            joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
            if joint >= 0:
                rest[model.jnt_qposadr[joint]] = angle
    rest[:2] = 0.0
    rest[3:7] = (1.0, 0.0, 0.0, 0.0)
    return rest


def _extent(
    model: mujoco.MjModel, data: mujoco.MjData, base: int, bodies: set[int] | None
) -> tuple[float, float, float]:
    """Lowest and highest z, and the reach around the base's axis, of collision shapes."""
    low, high, reach = np.inf, -np.inf, 0.0
    colliding = (model.geom_contype | model.geom_conaffinity) != 0
    for geom in np.flatnonzero(colliding):
        if bodies is not None and model.geom_bodyid[geom] not in bodies:
            continue
        corners = _surface_points(model, geom) @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        round_m = _roundness(model, geom)
        low, high = min(low, corners[:, 2].min() - round_m), max(high, corners[:, 2].max() + round_m)
        flat = np.linalg.norm(corners[:, :2] - data.xpos[base, :2], axis=1)
        reach = max(reach, flat.max() + round_m)
    return low, high, reach


def _roundness(model: mujoco.MjModel, geom: int) -> float:
    return float(model.geom_size[geom, 0]) if model.geom_type[geom] in (_SPHERE, _CAPSULE) else 0.0


def _surface_points(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Points (n, 3) in the geom's frame whose hull, grown by its roundness, is its shape."""
    kind = model.geom_type[geom]
    if kind == _MESH:
        mesh = model.geom_dataid[geom]
        start = model.mesh_vertadr[mesh]
        return model.mesh_vert[start : start + model.mesh_vertnum[mesh]].astype(np.float64)
    if kind == _SPHERE:
        return np.zeros((1, 3))
    if kind == _CAPSULE:
        return np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]) * model.geom_size[geom, 1]
    centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    return centre + signs * half


def _ancestors(model: mujoco.MjModel, body: int) -> Iterator[int]:
    """``body`` and the bodies above it, from the top one down; not the world."""
    chain = []
    while body != 0:
        chain.append(int(body))
        body = model.body_parentid[body]
    return reversed(chain)


def _joints_of(model: mujoco.MjModel, body: int) -> range:
    start = int(model.body_jntadr[body])
    return range(start, start + int(model.body_jntnum[body])) if start >= 0 else range(0)


def _is_hinge(model: mujoco.MjModel, joint: int) -> bool:
    return bool(model.jnt_type[joint] == _HINGE)


def _about(model: mujoco.MjModel, joints: Sequence[int], axis: int) -> int | None:
    """The first of ``joints`` that turns about its body's ``axis``."""
    return next((j for j in joints if abs(model.jnt_axis[j, axis]) > 0.9), None)
