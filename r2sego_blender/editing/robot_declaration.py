"""The robot and the behaviour scope of a scene: declared, checked, and described for people."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..bundle import layout
from ..bundle.figures import ROBOT_FACTS
from ..bundle.layout import SCOPE_FILE
from ..bundle.scene import Scene
from ..captures.store import CAPTURES
from ..core.errors import GeometryError, RobotError, SceneError
from ..core.json_files import write_json
from ..core.progress import SILENT, Progress
from ..geometry.objects.prior_files import PRIOR_RECORDS, PRIORS, object_place
from ..geometry.proxy.proxy import PROXY
from ..refine.behaviour import DeclaredBehaviour
from ..robot.behaviours.sit_on import ANY_SEAT
from ..robot.behaviours.trajectory import Seat
from ..robot.controllers.controller import check_controller
from ..robot.model.model import RobotModel
from ..robot.model.model_camera import eyes
from ..robot.model.robot_file import EMBEDDED
from ..robot.motion.motion_facts import motion_facts, motion_line
from ..robot.planning.free_floor import free_floor, require_floor
from ..robot.planning.seats import TARGET_M, find_seats
from ..robot.rollouts.assumptions import bounded_links_line
from ..robot.scope.region import area_m2
from ..robot.scope.scope import FREE_FLOOR, BehaviourScope, shipped_scopes
from ..robot.scope.scope_file import changed_scope, save_scope
from .trial_rollouts import newest_surface

_SEEN_DEG = 5.0  # a turn of the camera that is worth a word
_UPRIGHT = 0.99
_FARTHEST_CAMERA_M = 10.0  # from its body; what lies farther was given in another unit


def declare_robot(
    scene: Scene,
    robot: str | None = None,
    scope: str | None = None,
    changes: Mapping[str, Any] | None = None,
    progress: Progress = SILENT,
) -> Scene:
    """Give the scene another robot or scope, or fields of its scope other values.

    ``changes`` are values by the fields' names, such as ``region.within``; None is the
    default again. They are written to a scope file of the bundle's own, which becomes the
    scene's; shipped scopes and a person's files stay as they are. A robot that is given takes
    the place of the scope's own, and that one's mount goes unless it fits this robot, too; without
    one the scope's counts. ``progress`` is told what became of the mount, and of a region that has
    no floor on the newest collision surface. Returns the scene as declared then; the next run redoes
    what depends on it. Raises RobotError or GeometryError, and changes nothing then: a robot or a
    scope, its policy or motions that cannot be read or do not go together, or a target that is no
    object of the scene. Where nothing is given, nothing is looked at.
    """
    changes = dict(changes or {})
    if robot is None and scope is None and not changes:
        return scene
    with scene.locked():
        declared = scene.declaration
        if scope is None:
            source = declared.scope
        else:
            source = scope if scope in shipped_scopes() else str(Path(scope).resolve())
        given = BehaviourScope.load(source)
        if robot is None:
            robot = replaced = declared.robot
        else:
            robot = robot if robot.startswith("embedded:") else str(Path(robot).resolve())
            # A scope that is given with it, and names no robot, was written for it.
            replaced = given.robot.model or (declared.robot if scope is None else robot)
        if replaced != robot:
            mount = given.robot.mount
            kept = mount if mount is not None and _fits(mount, robot) else None
            changes = {"robot.model": None, "robot.mount": kept} | changes
        own = (scene.path / SCOPE_FILE).absolute()
        changed = changed_scope(given, changes, own) if changes else given
        _check(scene, changed, DeclaredBehaviour(changed, robot).model)
        if replaced != robot:
            _tell_mount(given.robot.mount, changed.robot.mount, progress)
        _tell_region(scene, changed, progress)
        if changed != given:
            with scene.publishing(SCOPE_FILE) as file:
                save_scope(changed, file)
            source = str(own)
        return scene.declare(robot=robot, scope=source)


def sitting_on(target: str, scope: str) -> dict[str, Any]:
    """The changes of ``scope`` that have the robot sit on ``any`` seat, an object, or at ``X,Y``."""
    x, comma, y = target.partition(",")
    place: Any = target
    if comma:
        try:
            place = [float(x), float(y)]
        except ValueError as error:
            raise RobotError(
                f"'{target}' is no place", where="sit_on.target", cure="Write metres as X,Y: 1.2,-0.4."
            ) from error
    changes = {"sit_on.target": place}
    if BehaviourScope.load(scope).behaviours.sit_on <= 0.0:
        changes["behaviours.sit_on"] = 1.0
    return changes


def describe_robot(scene: Scene, seats: bool = False) -> dict[str, Any]:
    """The declared robot, its camera and its scope, JSON-ready; and the ``seats``, if asked for.

    Lengths in metres, angles in degrees; the camera's height is the standing robot's. Seats
    are those on the newest collision surface, whatever the scope's target; ``no_seats`` says
    why there are none. Also written to ``ROBOT_FACTS``. Raises RobotError where robot or
    scope cannot be read.
    """
    declared = scene.declaration
    behaviour = DeclaredBehaviour.of(scene)
    scope, robot = behaviour.scope, behaviour.model
    source, _ = scope.robot_for(declared.robot)
    within = scope.region.within
    described = {
        "scene": str(scene.path),
        "robot": source,
        "name": source.removeprefix("embedded:") if source in EMBEDDED else Path(source).stem,
        "declared": [declared.robot, scene.name_of(declared.scope)],
        "joints": int(robot.model.njnt) - 1,
        "legs": len(robot.legs),
        "wheels": len(robot.wheels),
        "mass_kg": float(robot.model.body_mass.sum()),
        "height_m": robot.height_m,
        "reach_m": robot.radius_m,
        "cameras": eyes(robot.model),
        "camera": {
            "parent": robot.mount.parent,
            "height_m": robot.eye_height_m,
            "pitch_deg": robot.mount.pitch_down_deg,
            **_turned(robot),
            "fov_deg": robot.mount.fov_deg,
            "fov_is_vertical": robot.mount.vertical,
        },
        "controller": scope.controller.kind,
        "scope": scope.name,
        "behaviours": {name: weight for name, weight in vars(scope.behaviours).items() if weight > 0.0},
        "region_m2": None if isinstance(within, str) else abs(area_m2(within)),
        "target": scope.sit_on.target if scope.behaviours.sit_on > 0.0 else None,
        "camera_pitch_deg": scope.look.camera_pitch_deg,
        "duration_s": scope.episode.duration_s,
        "camera_rate_hz": scope.episode.camera_rate_hz,
        "objects": list(_object_names(scene)),
        "bounded_links": list(robot.bounded_links),
        "motions": [motion_facts(path) for path in scope.controller.motions if scope.controller.kind == "replay"],
    }
    if seats:
        try:
            described["seats"] = _described_seats(scene, scope, robot)
        except RobotError as error:
            described |= {"seats": [], "no_seats": str(error)}
    with scene.publishing(ROBOT_FACTS.name) as file:
        write_json(file, described)
    return described


def lines(described: dict[str, Any]) -> list[str]:
    """What ``describe_robot`` says, for a person."""
    d, camera = described, described["camera"]
    moves = f"{d['legs']} legs" if d["legs"] else f"{d['wheels']} driven wheels"
    fov = f"{camera['fov_deg']:.0f} degrees {'high' if camera['fov_is_vertical'] else 'wide'}"
    pitch = f"{abs(camera['pitch_deg']):.1f} degrees {'down' if camera['pitch_deg'] >= 0.0 else 'up'}"
    if abs(camera["left_deg"]) > _SEEN_DEG:
        side = "left" if camera["left_deg"] > 0.0 else "right"
        pitch += f", {abs(camera['left_deg']):.0f} degrees to the {side}"
    if abs(camera["rolled_deg"]) > _SEEN_DEG:
        pitch += f", rolled by {camera['rolled_deg']:.0f} degrees"
    if d["camera_pitch_deg"]:
        pitch += ", set from {:g} to {:g} before a rollout".format(*d["camera_pitch_deg"])
    behaviours = ", ".join(f"{name} {weight:g}" for name, weight in d["behaviours"].items())
    region = "the free floor" if d["region_m2"] is None else f"a polygon of {d['region_m2']:.2f} m2"
    text = [
        f"robot: {d['robot']}: {d['joints']} joints, {moves}, {d['height_m']:.2f} m, {d['mass_kg']:.1f} kg",
        f"camera: on {camera['parent']}, {camera['height_m']:.2f} m high, {pitch}, {fov}",
        f"scope: {d['scope']} ({behaviours}) within {region}; controller: {d['controller']}",
    ]
    text += filter(None, [bounded_links_line(d["bounded_links"]), *map(motion_line, d["motions"])])
    if d["target"] is not None:
        text.append(f"sits on: {d['target']}")
    for seat in d.get("seats", ()):
        x, y = seat["place_m"]
        name = seat["object"] or "a seat"
        places = "1 place" if seat["places"] == 1 else f"{seat['places']} places"
        text.append(f"{name} at ({x:.2f}, {y:.2f}), {seat['height_m']:.2f} m high, {places}")
    return [*text, d["no_seats"]] if d.get("no_seats") else text


def _turned(robot: RobotModel) -> dict[str, float]:
    """How far the standing robot's camera looks to the left of ahead, and is rolled about its axis.

    Both are 0 for one that looks straight up or down.
    """
    right, down, ahead = robot.camera_poses(robot.rest_qpos[None])[0, :3, :3].T
    if abs(ahead[2]) > _UPRIGHT:
        return {"left_deg": 0.0, "rolled_deg": 0.0}
    left, rolled = math.atan2(ahead[1], ahead[0]), math.atan2(-right[2], -down[2])
    return {"left_deg": math.degrees(left), "rolled_deg": math.degrees(rolled)}


def _fits(mount: Any, robot: str) -> bool:
    """Whether a scope's mount can be had of the robot: it has the body, or the camera of that name."""
    try:
        RobotModel.load(robot, mount)
    except RobotError:
        return False
    return True


def _tell_mount(before: Any, now: Any, progress: Progress) -> None:
    """Say what became of a scope's mount with another robot."""
    if before is not None and now is None:
        progress.message("The scope's robot.mount went with the robot that it was for.", "warning")
    elif before is not None and now == before:
        progress.message("The scope's robot.mount stays: it fits this robot, too. `--set robot.mount=` drops it.")


def _tell_region(scene: Scene, scope: BehaviourScope, progress: Progress) -> None:
    """Warn of a polygon without floor: drawn for a surface to come, or elsewhere by mistake."""
    if scope.region.within == FREE_FLOOR:
        return
    with contextlib.suppress(SceneError):  # no surface yet, or one of another world frame
        surface = newest_surface(scene)
        try:
            require_floor(scope, surface.collision_mjcf)
        except RobotError as error:
            progress.message(str(error), "warning")


def _check(scene: Scene, scope: BehaviourScope, robot: RobotModel) -> None:
    """Refuse what no rollout of ``robot`` could do."""
    check_controller(robot, scope)
    own = scope.robot.mount is None or isinstance(scope.robot.mount, str)
    where = robot.source if own else f"scope {scope.name}, robot.mount"
    away_m = float(np.linalg.norm(robot.mount.parent_from_camera[:3, 3]))
    if away_m > _FARTHEST_CAMERA_M:
        raise RobotError(
            f"the camera is {away_m:.0f} m from '{robot.mount.parent}', which it is fixed to",
            where=where,
            cure="Is the file in millimetres? Give metres." if own else "Give its place in metres.",
        )
    if robot.eye_height_m <= 0.0:
        raise RobotError(
            f"the camera is {-robot.eye_height_m:.2f} m below the floor that the robot stands on",
            where=where,
            cure="Set its place higher: x forward, y left, z up.",
        )
    target = scope.sit_on.target
    if scope.behaviours.sit_on > 0.0 and isinstance(target, str) and target != ANY_SEAT:
        known = _object_names(scene)
        if target not in known:
            cure = f"Known: {', '.join(known)}." if known else "Declare objects with `r2sego objects`."
            raise GeometryError(f"there is no object '{target}' to sit on", where=scene.path, cure=cure)


def _object_names(scene: Scene) -> tuple[str, ...]:
    """The declared objects, and those that have been aligned."""
    folder = scene.path / layout.OBJECTS
    names = {place.name for place in folder.iterdir() if place.is_dir()} if folder.is_dir() else set()
    if (scene.path / layout.PRIORS / "priors.json").is_file():
        names |= {record["name"] for record in scene.read(PRIOR_RECORDS)}
    return tuple(sorted(names))


def _described_seats(scene: Scene, scope: BehaviourScope, robot: RobotModel) -> list[dict[str, Any]]:
    """A seat for each surface to sit on: its middle place, and the object whose seat it is."""
    surface = newest_surface(scene)
    behaviour = DeclaredBehaviour(scope, scene.declaration.robot)
    priors = scene.read(PRIORS)
    placed = behaviour.placed(scene.read(CAPTURES), scene.read(PROXY.of_round(surface.round_index)), priors)
    placed = changed_scope(placed, {"sit_on.target": ANY_SEAT}, scene.path)
    floor = free_floor(robot, placed, surface.collision_mjcf)
    found = find_seats(robot.half_width_m, floor, placed.sit_on, surface.collision_mjcf)
    surfaces: dict[int, list[Seat]] = {}
    for seat in found:
        surfaces.setdefault(seat.surface, []).append(seat)
    objects = {prior.name: object_place(priors, prior.name) for prior in priors}
    return [_described(places, objects) for _, places in sorted(surfaces.items())]


def _described(places: list[Seat], objects: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
    middle = [sum(seat.edge_m[axis] for seat in places) / len(places) for axis in (0, 1)]
    seat = min(places, key=lambda one: math.dist(one.edge_m, middle))
    near = {name: min(math.dist(at, one.edge_m) for one in places) for name, at in objects.items()}
    name = min(near, key=near.__getitem__, default="")
    return {
        "place_m": list(seat.edge_m),
        "height_m": seat.height_m,
        "yaw_deg": math.degrees(seat.yaw_rad),
        "places": len(places),
        "object": name if name and near[name] <= TARGET_M else "",
    }
