"""Rollouts on the timeline: the robot's bodies as objects that move, and its head camera."""

from __future__ import annotations

import math
from collections.abc import Sequence

import bpy
import numpy as np

from ...core.errors import SceneError
from ...results.panels.bundle import Bundle
from ...results.panels.rollout_bodies import RobotBodies, digest_of
from ...results.panels.rollout_list import attempts
from ..shared import preview_range
from ..shared.cameras import create_camera, use_frame_of
from ..shared.materials import plain_material
from ..shared.meshes import assign_materials, mesh_from_arrays
from ..shared.moved_bundle import BUNDLE_MARK
from ..shared.outliner import find_collection, fresh_collection, link
from ..shared.simplified_viewport import draw_fewer_faces_of_robot, drawn_faces
from . import robot_playback
from .robot_playback import CAMERA, ROOT, Recording

PART = "Robot"
_CAMERA_SIZE_M = 0.15
_EMPTY_SIZE_M = 0.2


def show_rollouts(
    scene: bpy.types.Scene, bundle: Bundle, round_index: int, numbers: Sequence[int], *, look_through: bool = False
) -> list[bpy.types.Object]:
    """The robot along these rollouts of a round (or of the trial), in place of those shown before.

    Each rollout is an empty with an object a body and the head camera below it; those that
    never began are left out. Frame f of the timeline is the rollouts' frame f, at their rate but
    where a person has animated something: then the scene's time stays theirs.
    ``look_through`` makes the first one's camera the scene's. Returns the empties. Raises
    SceneError when there is no such rollout or its files are missing or damaged.
    """
    frames = {attempt.number: attempt.frames for attempt in attempts(bundle, round_index)}
    missing = [number for number in numbers if number not in frames]
    if missing:
        raise SceneError(f"there is no rollout {missing[0]}", where=bundle.path, cure="Choose another.")
    bodies = RobotBodies.load(bundle, round_index)
    asked, numbers = numbers, [number for number in numbers if frames[number]]
    if not numbers:
        which = f"rollout {asked[0]}" if len(asked) == 1 else "these rollouts"
        raise SceneError(f"{which} never began: there is nothing to show", cure="Choose another rollout.")
    recording = Recording.read(bundle, round_index, tuple(numbers), bodies)
    collection = fresh_collection(scene, bundle.path, PART)
    meshes = [_mesh(name, *shape) for name, shape in zip(bodies.names, bodies.shapes, strict=True)]
    roots = []
    for number in numbers:
        root = bpy.data.objects.new(f"Rollout {number}", None)
        root.empty_display_type, root.empty_display_size = "PLAIN_AXES", _EMPTY_SIZE_M
        robot_playback.mark(root, number, ROOT)
        link(collection, root)
        camera = create_camera(f"Head camera {number}", bodies.camera)
        camera.data.display_size = _CAMERA_SIZE_M
        parts = [bpy.data.objects.new(f"{mesh.name}, rollout {number}", mesh) for mesh in meshes]
        for index, part in enumerate([*parts, camera]):
            part.parent = root
            part.rotation_mode = "QUATERNION"
            robot_playback.mark(part, number, index if part != camera else CAMERA)
            link(collection, part)
        draw_fewer_faces_of_robot(parts, drawn_faces())
        if look_through and not roots:
            use_frame_of(camera, scene)
        roots.append(root)
    preview_range.give_back(scene)  # a clip's would cut the rollouts off
    if not _is_animated(scene):
        _use_time_of(recording, bodies.rate_hz, scene)
    robot_playback.play(collection, bundle, round_index, bodies.digest, recording)
    robot_playback.place(collection, scene.frame_current)
    return roots


def draw_fewer_faces_of_robots(most: int) -> None:
    """Have the views draw fewer faces of every robot along a shown rollout, with 0 all of them."""
    for root in (one for one in bpy.data.objects if robot_playback.body_of(one) == ROOT):
        bodies = [child for child in root.children if child.type == "MESH"]
        draw_fewer_faces_of_robot(bodies, most)


def are_shown(scene: bpy.types.Scene, bundle: Bundle, round_index: int, numbers: Sequence[int]) -> bool:
    """Whether exactly these rollouts, as they are in the bundle now, are shown."""
    shown = robot_playback.shown_rollouts(find_collection(scene, bundle.path, PART))
    return shown == (round_index, tuple(numbers), digest_of(bundle, round_index))


def _mesh(name: str, vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray) -> bpy.types.Mesh:
    mesh = mesh_from_arrays(f"Robot {name}", vertices, faces)
    palette, slots = np.unique(np.round(colours, 3), axis=0, return_inverse=True)
    materials = [
        plain_material("R2S-EGO robot {:.2f} {:.2f} {:.2f}".format(*colour), tuple(colour))
        for colour in palette.tolist()
    ]
    assign_materials(mesh, materials, slots.ravel())
    return mesh


def _is_animated(scene: bpy.types.Scene) -> bool:
    """Whether something that was not made of a bundle has keyframes, or drivers."""
    return any(one.animation_data is not None and BUNDLE_MARK not in one for one in scene.objects)


def _use_time_of(recording: Recording, rate_hz: float, scene: bpy.types.Scene) -> None:
    """Give the timeline the rollouts' frames and rate; Blender's rate is a whole number over another."""
    scene.frame_start, scene.frame_end = 0, max(1, recording.last_frame)
    scene.render.fps = max(1, math.ceil(rate_hz - 1e-6))
    scene.render.fps_base = scene.render.fps / rate_hz
