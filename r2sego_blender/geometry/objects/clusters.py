"""Objects found by geometry alone: what stands in the room, apart from floor, walls and each other.

Stands in for learned instance masks. The points that captures observed off the room's planes
fall into connected clusters; a capture's pixels belong to the cluster their completed depth
lies in. Things that touch are one object: a person parts them by drawing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from scipy import ndimage

from ...captures.capture import Capture
from ...core.errors import GeometryError
from ...core.images import resize_nearest
from ..room.completed_depth import CompletedDepth, DepthSource
from ..room.planes import RoomPlanes
from .objects import DeclaredObject

_VOXEL_M = 0.04
_LEAST_HITS = 2  # observed pixels in a voxel
_OFF_PLANES_M = 0.06  # nearer to the floor or a wall is floor or wall
_REACH_M = 0.10  # a pixel this far from a cluster still belongs to it
_LEAST_EXTENT_M, _LARGEST_EXTENT_M = 0.25, 3.0
_LEAST_VOXELS = 60
_LEAST_MASK_PX = 150
_LARGEST_GRID = 60_000_000


def find_objects(
    captures: Sequence[Capture], completed: Sequence[CompletedDepth], envelope: RoomPlanes
) -> tuple[DeclaredObject, ...]:
    """Masks of what stands in the room, larger things first, named ``cluster_00`` and so on.

    ``completed`` belongs to ``captures``, ``envelope`` are the room's bounds, the floor among
    them. Empty where nothing stands free. Deterministic. Raises GeometryError for what was
    observed over too far a reach.
    """
    everywhere = [view.camera.unproject(view.depth) for view in completed]
    off = [envelope.signed_distance(points) > _OFF_PLANES_M for points in everywhere]
    observed = [v.seen & o for v, o in zip(completed, off, strict=True)]
    points = np.concatenate([p[seen] for p, seen in zip(everywhere, observed, strict=True)])
    if not len(points):
        return ()
    low, high = np.quantile(points, [0.001, 0.999], axis=0)
    shape = np.ceil((high - low) / _VOXEL_M).astype(int) + 1
    if math.prod(shape.tolist()) > _LARGEST_GRID:
        size = " x ".join(f"{side:.0f}" for side in high - low)
        raise GeometryError(
            f"what was observed reaches over {size} m, too far to find objects in",
            where="objects --find",
            cure="Check the scale (`r2sego status`), or draw masks and give them with --masks.",
        )
    hits = np.zeros(shape, np.int32)
    cells = np.floor((points - low) / _VOXEL_M).astype(int)
    np.add.at(hits, tuple(cells[((cells >= 0) & (cells < shape)).all(1)].T), 1)
    labels = _clusters(hits >= _LEAST_HITS)
    distance, nearest = ndimage.distance_transform_edt(labels == 0, sampling=_VOXEL_M, return_indices=True)
    labels = np.where(distance <= _REACH_M, labels[tuple(nearest)], 0)
    images = [
        _labels_at(labels, np.floor((p - low) / _VOXEL_M).astype(int), o & (v.source != DepthSource.ENVELOPE))
        for p, o, v in zip(everywhere, off, completed, strict=True)
    ]
    return _objects(captures, images, int(labels.max()))


def _clusters(occupied: np.ndarray) -> np.ndarray:
    """Numbered connected clusters of the size of furniture, the largest first."""
    numbers, count = ndimage.label(occupied, structure=np.ones((3, 3, 3)))
    sizes = np.bincount(numbers.ravel(), minlength=count + 1)
    kept = []
    for number, box in enumerate(ndimage.find_objects(numbers), start=1):
        extent = max(part.stop - part.start for part in box) * _VOXEL_M
        if sizes[number] >= _LEAST_VOXELS and _LEAST_EXTENT_M <= extent <= _LARGEST_EXTENT_M:
            kept.append(number)
    kept.sort(key=lambda number: -sizes[number])
    renumbered = np.zeros(count + 1, np.int32)
    renumbered[kept] = np.arange(1, len(kept) + 1)
    return renumbered[numbers]


def _labels_at(labels: np.ndarray, cells: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """(H, W) the clusters in which the pixels' points lie, 0 for none."""
    inside = usable & ((cells >= 0) & (cells < labels.shape)).all(-1)
    found = np.zeros(usable.shape, np.int32)
    found[inside] = labels[tuple(cells[inside].T)]
    return found


def _objects(captures: Sequence[Capture], images: Sequence[np.ndarray], count: int) -> tuple[DeclaredObject, ...]:
    square = np.ones((5, 5), np.uint8)
    objects: list[DeclaredObject] = []
    for number in range(1, count + 1):
        masks = {}
        for capture, image in zip(captures, images, strict=True):
            mask = (image == number).astype(np.uint8)
            mask = cv2.morphologyEx(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, square), cv2.MORPH_OPEN, square)
            if mask.sum() < _LEAST_MASK_PX:
                mask[:] = 0
            masks[capture.name] = resize_nearest(mask, *capture.camera.shape) > 0
        if sum(mask.any() for mask in masks.values()) >= 2:
            name = f"cluster_{len(objects):02d}"
            objects.append(DeclaredObject(name, masks, backends={"masks": "clusters"}))
    return tuple(objects)
