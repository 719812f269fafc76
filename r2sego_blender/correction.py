"""Correcting where a scene's floor lies, which way is up and how long a metre is."""

from __future__ import annotations

import shutil
from collections.abc import Sequence

import numpy as np

from .captures.floor_points import FloorPoint, ground_of, ground_through
from .captures.ground_picture import GROUND_PICTURES, save_ground_pictures
from .captures.registration import Registration, corrected
from .captures.scale import Scale
from .captures.sparse import SparsePoints
from .captures.store import load_captures, save_captures
from .errors import CaptureError
from .object_priors import move_objects
from .progress import SILENT, Progress
from .scene import Scene


def correct_registration(
    scene: Scene,
    *,
    floor: Sequence[FloorPoint] = (),
    up: Sequence[float] | None = None,
    floor_at_m: float | None = None,
    scale: Scale | None = None,
    progress: Progress = SILENT,
) -> Scene:
    """Move the scene to another world frame by one similarity; returns the scene as declared then.

    The ground goes through the points ``floor``, or has the direction ``up`` and lies
    ``floor_at_m`` above z = 0, both as the world is now; pixels of ``floor`` and ``scale``
    are those of the bundle's images. Captures, sparse points and the declaration are moved
    together, and every step that reads them redoes itself on the next run. Raises
    CaptureError when the ground or the scale cannot be told, and changes nothing then.
    """
    by_hand = up is not None or floor_at_m is not None
    if (floor and by_hand) or not (floor or by_hand or scale):
        raise CaptureError(
            "the ground is given twice" if floor else "nothing is to be corrected", where=scene.path,
            cure="Show floor points, or give up and the floor's height, or a scale.",
        )  # fmt: skip
    with scene.locked():
        captures = load_captures(scene.captures_folder)
        sparse = SparsePoints.load(scene.captures_folder / "sparse.npz")
        ground = None
        if floor:
            ground = ground_through(captures, sparse, floor, progress)
        elif by_hand:
            ground = ground_of(captures, up, floor_at_m or 0.0)
        declared = scene.declaration
        before = Registration(
            np.array(declared.world_from_capture), declared.ground, declared.scale_source
        )  # fmt: skip
        after, similarity = corrected(before, captures, sparse, ground, scale, progress)
        # A picture of the old floor must not be taken for the new one's.
        shutil.rmtree(scene.path / GROUND_PICTURES, ignore_errors=True)
        with scene.publishing("captures") as folder:
            # What others keep there, such as masks, does not depend on the frame.
            shutil.copytree(scene.captures_folder, folder, dirs_exist_ok=True)
            moved = [capture.transformed(similarity) for capture in captures]
            save_captures(folder, moved, sparse.transformed(similarity))
        move_objects(scene, similarity)
        with scene.publishing(GROUND_PICTURES) as folder:
            save_ground_pictures(folder, load_captures(scene.captures_folder))
        return scene.declare(
            world_from_capture=tuple(map(tuple, after.world_from_capture.tolist())),
            ground=after.ground, scale_source=after.scale_source,
        )  # fmt: skip
