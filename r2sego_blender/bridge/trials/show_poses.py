"""Where robot and chair are to stand for a trial, as outlines on the floor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...trials.running.live import Pose
from ..shared.materials import plain_material
from ..shared.outliner import find_collection, fresh_collection, link

PART = "Trial poses"
_WHICH = "r2sego_trial_pose"
_WIDTH_M = 0.008
_ROBOT, _CHAIR = (0.13, 0.62, 0.59), (0.95, 0.6, 0.2)  # teal as the behaviour region, and amber

Line = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class _Outline:
    """Closed lines, and open ones, metres, of something that faces along +x."""

    closed: tuple[Line, ...]
    open: tuple[Line, ...]


_SIDES = 32
_RADIUS_M = 0.25
_ROBOT_OUTLINE = _Outline(
    closed=(
        tuple(
            (_RADIUS_M * math.cos(math.tau * side / _SIDES), _RADIUS_M * math.sin(math.tau * side / _SIDES))
            for side in range(_SIDES)
        ),
    ),
    open=(((0.0, 0.0), (0.55, 0.0)), ((0.45, 0.08), (0.55, 0.0), (0.45, -0.08))),
)
_HALF_M = 0.225
_CHAIR_OUTLINE = _Outline(
    closed=(
        ((-_HALF_M, -_HALF_M), (_HALF_M, -_HALF_M), (_HALF_M, _HALF_M), (-_HALF_M, _HALF_M)),
        ((-_HALF_M - 0.05, -_HALF_M), (-_HALF_M, -_HALF_M), (-_HALF_M, _HALF_M), (-_HALF_M - 0.05, _HALF_M)),
    ),
    open=(((0.0, 0.0), (0.4, 0.0)), ((0.32, 0.06), (0.4, 0.0), (0.32, -0.06))),
)


def show_poses(
    scene: bpy.types.Scene, study: Path, trial: str, robot: Pose, chair: Pose, chair_type: str
) -> list[bpy.types.Object]:
    """The outlines of robot and chair for a trial of the study in a folder, in place of those shown before.

    Each object stands at its pose, turned about z, so that Blender's Item tab tells the numbers; an arrow
    shows the way it faces, and its name the ``trial``. Sizes are of no robot or chair: the middle counts.
    """
    collection = fresh_collection(scene, study, PART)
    for which, outline, colour in (("robot", _ROBOT_OUTLINE, _ROBOT), ("chair", _CHAIR_OUTLINE, _CHAIR)):
        drawn = bpy.data.objects.new(which, _curve(which, outline, colour))
        drawn[_WHICH] = which
        drawn.lock_location = drawn.lock_rotation = (True, True, True)
        drawn.show_name = drawn.show_in_front = True
        link(collection, drawn)
    return move_poses(scene, study, trial, robot, chair, chair_type)


def move_poses(
    scene: bpy.types.Scene, study: Path, trial: str, robot: Pose, chair: Pose, chair_type: str
) -> list[bpy.types.Object]:
    """Those that ``show_poses`` made, at the poses of another trial; none where they are not shown.

    Nothing is made or removed, so that a timer may do it between two steps to undo.
    """
    collection = find_collection(scene, study, PART)
    shown: dict[str, bpy.types.Object] = {}
    for one in collection.objects if collection is not None else ():
        if _WHICH in one:
            shown.setdefault(one[_WHICH], one)  # copies stand behind, and are a person's own
    for drawn in shown.values():
        is_robot = drawn[_WHICH] == "robot"
        x, y, heading_deg = robot if is_robot else chair
        drawn.name = f"{'Robot' if is_robot else chair_type}, {trial}"
        drawn.location, drawn.rotation_euler = (x, y, 0.0), (0.0, 0.0, math.radians(heading_deg))
    return list(shown.values())


def _curve(name: str, outline: _Outline, colour: tuple[float, float, float]) -> bpy.types.Curve:
    data = bpy.data.curves.new(name, "CURVE")
    data.dimensions, data.bevel_depth = "3D", _WIDTH_M
    for lines, cyclic in ((outline.closed, True), (outline.open, False)):
        for line in lines:
            spline = data.splines.new("POLY")
            spline.points.add(len(line) - 1)
            spline.points.foreach_set("co", [value for x, y in line for value in (x, y, 0.0, 1.0)])
            spline.use_cyclic_u = cyclic
    data.materials.append(plain_material(f"R2S-EGO trial, {name}", colour))
    return data
