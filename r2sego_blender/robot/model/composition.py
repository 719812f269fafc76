"""The robot in the scene's collision surface: one MuJoCo model with servos on every joint."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from ...config.settings import RolloutSettings
from ...core.errors import RobotError
from .efforts import effort
from .humanoid import Servo
from .model import RobotModel
from .robot_file import robot_spec
from .structure import Leg

_PREFIX = "robot/"
_REFERENCE, _TRACKED = "tracking reference", "tracked base"
# The tracking wrench of a 35 kg robot, which follows its reference to about a centimetre.
_FORCE = Servo(3000.0, 600.0)  # N/m, N s/m
_TORQUE = Servo(800.0, 60.0)  # N m/rad, N m s/rad
# Stiffer contacts than MuJoCo's, which let feet sink in by half a centimetre.
_SOLREF, _SOLIMP = (0.01, 1.0), (0.95, 0.99)
_MUJOCO_SOLREF = (0.02, 1.0)
# Of fixed casters: as the embedded wheeled base has them.
_SKID_FRICTION = (0.01, 0.001, 0.0001)
_ROBOT_BIT, _SCENE_BIT = 1, 2
# Contact forces settle well below a millimetre at these; the default is twice as slow.
_SOLVER_ITERATIONS = 20
_SOLVER_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Composition:
    """A simulated robot in a scene.

    ``qpos`` is the robot's own, since the scene is static. With the helping wrench the first
    six actuators pull the base towards the mocap body ``reference`` along and about its axes;
    the others drive a joint each. ``qpos_address`` (joints,) and ``dof_address`` (nu,) int say
    where their coordinates are, ``stiffness`` and ``damping`` (nu,) float64 how they pull.
    ``legs`` are the robot's, with the bodies and joints of ``model``. (ngeom,) bool are
    ``scene_geoms``, ``foot_geoms``, which may touch the floor, and ``seat_geoms``, which may
    touch a seat: the base and the legs above the feet.
    """

    model: mujoco.MjModel
    legs: tuple[Leg, ...]
    foot_geoms: np.ndarray
    seat_geoms: np.ndarray
    scene_geoms: np.ndarray
    robot_mass_kg: float
    has_wrench: bool
    qpos_address: np.ndarray
    dof_address: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray

    @property
    def joint_dof_address(self) -> np.ndarray:
        """(joints,) int: where the joints' velocities are."""
        return self.dof_address[len(self.dof_address) - len(self.qpos_address) :]

    def geom_label(self, geom: int) -> str:
        """The geom's name as a person knows it, or its body's."""
        name = self.model.geom(geom).name
        if not name and self.scene_geoms[geom]:
            return "the scene"
        return (name or self.model.body(self.model.geom_bodyid[geom]).name).removeprefix(_PREFIX)

    def joint_label(self, joint: int) -> str:
        """The joint's name in the robot's own file."""
        return self.model.joint(joint).name.removeprefix(_PREFIX)


def scene_spec(collision_mjcf: Path) -> mujoco.MjSpec:
    """The collision scene, editable. Raises RobotError: missing, unreadable or not static."""
    if not Path(collision_mjcf).is_file():
        raise RobotError(
            "there is no such collision scene", where=collision_mjcf, cure="Make the collision surface first."
        )
    try:
        spec = mujoco.MjSpec.from_file(str(collision_mjcf))
    except (ValueError, mujoco.FatalError) as error:
        raise _scene_error(collision_mjcf, error) from error
    if spec.joints:
        raise RobotError(
            f"the collision scene has {len(spec.joints)} joints", where=collision_mjcf, cure="Give a static scene."
        )
    for geom in spec.geoms:
        if not (geom.contype or geom.conaffinity):  # only drawn; rays would meet it
            spec.delete(geom)
    return spec


def compile_scene(spec: mujoco.MjSpec, collision_mjcf: Path) -> mujoco.MjModel:
    """``spec`` compiled. Raises RobotError with MuJoCo's words."""
    try:
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise _scene_error(collision_mjcf, error) from error


def geom_bounds(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corners (ngeom, 3) of all geoms at qpos0; planes are infinite.

    A level plane's top is its height.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    rotation = data.geom_xmat.reshape(-1, 3, 3)
    centre = data.geom_xpos + np.einsum("gij,gj->gi", rotation, model.geom_aabb[:, :3])
    half = np.einsum("gij,gj->gi", np.abs(rotation), model.geom_aabb[:, 3:])
    low, high = centre - half, centre + half
    planes = model.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE)
    low[planes], high[planes] = -np.inf, np.inf
    level = planes & (rotation[:, 2, 2] > 1.0 - 1e-9)
    high[level, 2] = data.geom_xpos[level, 2]
    return low, high


def compose(
    robot: RobotModel,
    collision_mjcf: Path,
    settings: RolloutSettings,
    servos: Mapping[str, Servo] | None = None,
    wrench: bool = True,
    step_s: float | None = None,
    furnish: Callable[[mujoco.MjSpec], None] | None = None,
) -> Composition:
    """Attach ``robot`` to the scene of ``collision_mjcf``, ready to be driven.

    ``servos`` by joint, in the actuators' order, replace the robot's own; ``wrench`` adds the
    helping wrench that tracks a reference; ``step_s`` replaces the settings' time step, and
    ``furnish`` adds fixed bodies to the scene. The robot meets the scene but not itself: its
    reference motions keep its limbs apart, and convex hulls of neighbouring links would fight
    each other. Raises RobotError.
    """
    spec = scene_spec(collision_mjcf)
    if furnish is not None:
        furnish(spec)
    for geom in spec.geoms:
        geom.contype, geom.conaffinity = _SCENE_BIT, _ROBOT_BIT
        if wrench and np.array_equal(geom.solref, _MUJOCO_SOLREF):  # else it says how soft it is
            _stiffen(geom)
    body = robot_spec(robot.source, bounded=bool(robot.bounded_links))
    for geom in body.geoms:
        if geom.contype or geom.conaffinity:
            geom.contype, geom.conaffinity = _ROBOT_BIT, _SCENE_BIT
        if wrench:
            _stiffen(geom)
    for element in [*body.sensors, *body.actuators, *body.keys]:
        body.delete(element)
    spec.attach(body, prefix=_PREFIX, frame=spec.worldbody.add_frame())
    own = robot.model
    gains = []
    if wrench:
        gains = _add_tracking_wrench(spec, _PREFIX + own.body(robot.base).name, robot.mass_scale, settings)
    servos = robot.servos() if servos is None else servos
    for name, servo in servos.items():
        actuator = spec.add_actuator(name=name, target=_PREFIX + name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        _limit(actuator, servo, effort(own, own.joint(name).id))
        gains.append(servo)
    spec.option.timestep = settings.step_s if step_s is None else step_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.iterations = _SOLVER_ITERATIONS
    spec.option.tolerance = _SOLVER_TOLERANCE
    model = compile_scene(spec, collision_mjcf)
    _let_skids_slide(robot, model)
    of_robot = np.array([model.body(index).name.startswith(_PREFIX) for index in range(model.nbody)])
    joints = [model.joint(_PREFIX + name).id for name in servos]
    legs = tuple(_in_composition(robot, model, leg) for leg in robot.legs)
    above = {int(own.jnt_bodyid[joint]) for leg in robot.legs for joint in leg.joints}
    above = {_body(robot, model, body) for body in [robot.base, *above]}
    above -= {body for leg in legs for body in leg.foot_bodies}
    grounded = [_body(robot, model, body) for body in robot.ground_bodies]
    return Composition(
        model=model,
        legs=legs,
        foot_geoms=np.isin(model.geom_bodyid, grounded),
        seat_geoms=np.isin(model.geom_bodyid, [*above]),
        scene_geoms=~of_robot[model.geom_bodyid],
        robot_mass_kg=float(model.body_mass[of_robot].sum()),
        has_wrench=wrench,
        qpos_address=model.jnt_qposadr[joints],
        dof_address=np.concatenate([np.arange(6 if wrench else 0), model.jnt_dofadr[joints]]),
        stiffness=np.array([servo.stiffness for servo in gains]),
        damping=np.array([servo.damping for servo in gains]),
    )


def _body(robot: RobotModel, model: mujoco.MjModel, body: int) -> int:
    return int(model.body(_PREFIX + robot.model.body(body).name).id)


def _let_skids_slide(robot: RobotModel, model: mujoco.MjModel) -> None:
    """Let fixed casters slide, which would brake the robot with the floor's friction: a URDF has no word for theirs.

    Those with a ``priority`` have a friction of their own.
    """
    for geom in robot.skid_geoms:
        body = int(robot.model.geom_bodyid[geom])
        here = int(model.body_geomadr[_body(robot, model, body)] + geom - robot.model.body_geomadr[body])
        if model.geom_priority[here] == 0:
            model.geom_friction[here], model.geom_priority[here] = _SKID_FRICTION, 1


def _in_composition(robot: RobotModel, model: mujoco.MjModel, leg: Leg) -> Leg:
    return replace(
        leg,
        foot=_body(robot, model, leg.foot),
        joints=tuple(model.joint(_PREFIX + robot.model.joint(joint).name).id for joint in leg.joints),
        foot_bodies=tuple(_body(robot, model, body) for body in leg.foot_bodies),
    )


def _add_tracking_wrench(spec: mujoco.MjSpec, base: str, scale: float, settings: RolloutSettings) -> list[Servo]:
    """Six bounded servos between the base and a mocap body that carries the reference."""
    spec.worldbody.add_body(name=_REFERENCE, mocap=True).add_site(name=_REFERENCE)
    spec.body(base).add_site(name=_TRACKED)
    gains = []
    for axis in range(6):
        gain, bound = (_FORCE, settings.max_force_n) if axis < 3 else (_TORQUE, settings.max_torque_nm)
        servo = Servo(gain.stiffness * scale, gain.damping * scale)
        actuator = spec.add_actuator(
            name=f"tracking {axis}",
            target=_TRACKED,
            refsite=_REFERENCE,
            trntype=mujoco.mjtTrn.mjTRN_SITE,
            gear=np.eye(6)[axis],
        )
        _limit(actuator, servo, bound * scale)
        gains.append(servo)
    return gains


def _stiffen(geom: mujoco.MjsGeom) -> None:
    geom.solref, geom.solimp[:2] = _SOLREF, _SOLIMP


def _limit(actuator: mujoco.MjsActuator, servo: Servo, bound: float) -> None:
    actuator.set_to_position(kp=servo.stiffness, kv=servo.damping)
    if bound > 0.0:
        actuator.forcelimited = True
        actuator.forcerange = (-bound, bound)


def _scene_error(collision_mjcf: Path, error: Exception) -> RobotError:
    words = " ".join(str(error).split()).rstrip(".")
    return RobotError(
        f"the collision scene does not compile: {words}", where=collision_mjcf, cure="Make the collision surface again."
    )
