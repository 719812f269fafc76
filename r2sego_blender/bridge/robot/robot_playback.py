"""Shown rollouts follow the timeline: a handler sets every body's place for the frame, without keyframes.

What is shown stands in the .blend (which rollouts, on the collection; which body, on each
object); the poses stay in the bundle and are read when they are needed first.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from ...core.errors import R2SEgoError
from ...results.panels.bundle import Bundle
from ...results.panels.rollout_bodies import RobotBodies
from ...results.panels.rollout_list import camera_poses
from ..shared.cameras import object_pose
from ..shared.moved_bundle import BUNDLE_MARK

_RECORDING = "r2sego_recording"
_ROLLOUT, _BODY = "r2sego_rollout", "r2sego_body"
CAMERA, ROOT = -1, -2
"""In place of a body's index: the head camera, and the empty that all of them hang on."""


@dataclass(frozen=True)
class Recording:
    """The poses of shown rollouts by their numbers: (T, B + 2, 4, 4) float64 of Blender objects, the
    root, at the first body's place, and the head camera last. All others are from the root."""

    poses: dict[int, np.ndarray]

    @staticmethod
    def read(bundle: Bundle, round_index: int, numbers: tuple[int, ...], bodies: RobotBodies) -> Recording:
        """Read the poses. Raises SceneError when they are damaged."""
        poses = {}
        for number in numbers:
            cameras = object_pose(camera_poses(bundle, round_index, number))[:, None]
            parts = np.concatenate([bodies.poses(number), cameras], axis=1)
            # Blender draws a line from each part to its root: one that moves along keeps them short.
            roots = np.tile(np.eye(4), (len(parts), 1, 1, 1))
            roots[..., :3, 3] = parts[:, :1, :3, 3]
            parts[..., :3, 3] -= roots[..., :3, 3]
            poses[number] = np.concatenate([parts[:, :-1], roots, parts[:, -1:]], axis=1)
        return Recording(poses)

    @property
    def last_frame(self) -> int:
        """The last frame of the longest rollout."""
        return max((len(poses) for poses in self.poses.values()), default=1) - 1


_recordings: dict[tuple[str, str], Recording | None] = {}


def mark(shown: bpy.types.Object, number: int, body: int) -> None:
    """Say which body of which rollout an object is."""
    shown[_ROLLOUT], shown[_BODY] = number, body


def body_of(shown: bpy.types.Object) -> int | None:
    """Which body an object is marked as, or CAMERA or ROOT; None for none."""
    return shown.get(_BODY)


def play(collection: bpy.types.Collection, bundle: Bundle, round_index: int, digest: str, recording: Recording) -> None:
    """Have the collection's marked objects follow the timeline from now on."""
    told = {"round": round_index, "rollouts": [*recording.poses], "digest": digest}
    collection[BUNDLE_MARK], collection[_RECORDING] = str(bundle.path), json.dumps(told)
    _recordings.clear()
    _recordings[_key(collection)] = recording


def shown_rollouts(collection: bpy.types.Collection | None) -> tuple[int, tuple[int, ...], str] | None:
    """The round, or TRIAL, the numbers and the digest of the rollouts a collection shows; None for none."""
    told = collection.get(_RECORDING) if collection is not None else None
    if not told:
        return None
    told = json.loads(told)
    return told["round"], tuple(told["rollouts"]), told["digest"]


def place(collection: bpy.types.Collection, frame: int) -> None:
    """Set every marked object's place at ``frame``; a rollout that has ended stays at its end."""
    recording = _recording(collection)
    if recording is None:
        return
    objects = collection.objects
    matrices = np.empty((len(objects), 4, 4), np.float32)
    objects.foreach_get("matrix_basis", matrices.reshape(-1))
    moved = []
    for index, shown in enumerate(objects):
        number = shown.get(_ROLLOUT)
        poses = recording.poses.get(number) if number is not None else None
        body = shown.get(_BODY)
        if poses is not None and len(poses) and isinstance(body, int) and ROOT <= body < poses.shape[1]:
            matrices[index] = poses[min(max(frame, 0), len(poses) - 1), body].T
            moved.append((shown, matrices[index]))
    # Set one by one, each would have the side bar, the outliner and the properties drawn anew. But what a
    # person put there would not come back as it was: a matrix tells no turns beyond a full one.
    if len(moved) == len(objects):
        objects.foreach_set("matrix_basis", matrices.reshape(-1))
    else:
        for shown, matrix in moved:
            shown.matrix_basis = Matrix(matrix.T)
    for shown, _ in moved:
        shown.update_tag(refresh={"OBJECT"})


def forget() -> None:
    """Read the poses again when they are needed next."""
    _recordings.clear()


def register() -> None:
    """Begin to follow the timeline."""
    # Before Blender evaluates the frame: afterwards it would have to do so twice.
    bpy.app.handlers.frame_change_pre.append(_frame_changed)
    bpy.app.handlers.load_post.append(_file_loaded)


def unregister() -> None:
    """Follow it no longer."""
    bpy.app.handlers.load_post.remove(_file_loaded)
    bpy.app.handlers.frame_change_pre.remove(_frame_changed)
    forget()


@bpy.app.handlers.persistent
def _frame_changed(scene: bpy.types.Scene, *_: object) -> None:
    for collection in _playing(scene):
        place(collection, scene.frame_current)


@bpy.app.handlers.persistent
def _file_loaded(*_: object) -> None:
    forget()


def _playing(scene: bpy.types.Scene) -> Iterator[bpy.types.Collection]:
    for collection in scene.collection.children_recursive:
        if _RECORDING in collection:
            yield collection


def _key(collection: bpy.types.Collection) -> tuple[str, str]:
    return collection.get(BUNDLE_MARK, ""), collection[_RECORDING]


def _recording(collection: bpy.types.Collection) -> Recording | None:
    """The recording a collection tells of; None, once and for all, where it is not there any more."""
    key = _key(collection)
    if key not in _recordings:
        try:
            path, where = key[0], json.loads(key[1])
            bundle = Bundle.open(path)
            bodies = RobotBodies.load(bundle, where["round"])
            is_same = bodies.digest == where["digest"]
            numbers = tuple(where["rollouts"])
            _recordings[key] = Recording.read(bundle, where["round"], numbers, bodies) if is_same else None
        except (R2SEgoError, ValueError, LookupError, TypeError):
            _recordings[key] = None
    return _recordings[key]
