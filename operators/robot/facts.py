"""The cached facts of the sub-panel Robot, read whenever the bundle or the shown round changes."""

import bpy

from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.robot_facts import RobotFacts
from ...r2sego_blender.results.panels.rollout_list import TRIAL, attempts, has_rollouts
from ...r2sego_blender.robot.scope.region import format_polygon
from .. import state


def read(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """Read the scope, the seats and the attempts. What cannot be read becomes the room's problem."""
    robot = scene.r2sego_robot
    robot.seats.clear()
    robot.attempts.clear()
    robot.region = robot.problem = ""
    try:
        _read_declared(scene, bundle)
        _read_attempts(scene, bundle)
    except R2SEgoError as error:
        robot.problem = str(error)
    redraw_views()


def read_again(scene: bpy.types.Scene) -> None:
    """Read the attempts of the source now chosen."""
    scene.r2sego_robot.problem = ""
    try:
        bundle = state.bundle_of(scene)
        if bundle is not None:
            _read_attempts(scene, bundle)
    except R2SEgoError as error:
        scene.r2sego_robot.problem = str(error)


def round_of(scene: bpy.types.Scene, trial: bool, round_index: int = -1) -> int:
    """The round to show: TRIAL, the one named, or where that is negative the one shown."""
    if trial:
        return TRIAL
    return scene.r2sego.round_index if round_index < 0 else round_index


def _read_declared(scene: bpy.types.Scene, bundle: Bundle) -> None:
    robot, known = scene.r2sego_robot, RobotFacts.read(bundle)
    robot.region = format_polygon(known.region)
    for found in known.seats:
        seat = robot.seats.add()
        seat.object_name, seat.place = found.object_name, found.place_m
        seat.height, seat.places = found.height_m, found.places
    for label, value in known.lines():
        fact = scene.r2sego.facts.add()
        fact.section, fact.label, fact.value = "robot", label, value


def _read_attempts(scene: bpy.types.Scene, bundle: Bundle) -> None:
    robot = scene.r2sego_robot
    robot.attempts.clear()
    robot.succeeded = 0
    index = round_of(scene, robot.source == "TRIAL")
    for one in attempts(bundle, index) if has_rollouts(bundle, index) else ():
        attempt = robot.attempts.add()
        attempt.number, attempt.behaviour, attempt.success = one.number, one.behaviour, one.success
        attempt.reason, attempt.outcome = one.reason, one.outcome
        attempt.frame, attempt.frames, attempt.time_s = one.frame, one.frames, one.time_s
        robot.succeeded += one.success
