"""Parts of space in which Gaussians are deleted, as JSON and as a test of their centres.

NumPy alone: Blender marks with the same test what the engine deletes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..core.cameras import Camera
from ..core.errors import AssetError

_MOST_CORNERS = 10_000
"""Of a lasso: every one of them is asked of every point."""

_LARGEST_CELL = 1 << 20
"""Cells are numbered from minus this to this along each axis, so that three fit into 64 bits."""

_LARGEST_WHOLE = 2.0**53  # float64 has all whole numbers below


@dataclass(frozen=True)
class Box:
    """A box of any pose: ``world_from_box`` (4, 4) affine, ``half_extents`` (3,) in the box's frame."""

    world_from_box: np.ndarray
    half_extents: np.ndarray

    def holds(self, means: np.ndarray) -> np.ndarray:
        """(N,) bool: which of the points (N, 3), metres, lie inside or on the box."""
        linear, origin = self.world_from_box[:3, :3], self.world_from_box[:3, 3]
        local = (np.asarray(means, np.float64) - origin) @ np.linalg.inv(linear).T
        return (np.abs(local) <= self.half_extents).all(axis=1)

    def transformed(self, similarity: np.ndarray) -> Box:
        """The box after a (4, 4) similarity of the world."""
        return Box(similarity @ self.world_from_box, self.half_extents)

    def to_json(self) -> dict[str, Any]:
        """As ``region_of`` reads it."""
        return {
            "kind": "box",
            "world_from_box": self.world_from_box.tolist(),
            "half_extents": self.half_extents.tolist(),
        }


@dataclass(frozen=True)
class Lasso:
    """What a camera sees inside a polygon, between two depths.

    ``polygon_px`` (P, 2) pixels, closed, by the even-odd rule; ``near_m`` and ``far_m`` bound
    the planar depth. An ``orthographic`` camera has parallel rays and ``fx``, ``fy`` in pixels
    a metre. Of ``kept_sides`` (K, 4), planes in the world, it sees the positive side alone.
    """

    camera: Camera
    polygon_px: np.ndarray
    near_m: float
    far_m: float
    orthographic: bool = False
    kept_sides: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))

    def holds(self, means: np.ndarray) -> np.ndarray:
        """(N,) bool: which of the points (N, 3), metres, are seen inside the polygon."""
        means = np.asarray(means, np.float64)
        local = means @ self.camera.camera_from_world[:3, :3].T + self.camera.camera_from_world[:3, 3]
        depth = local[:, 2]
        held = (depth >= self.near_m) & (depth <= self.far_m) & (self.orthographic | (depth > 0.0))
        held &= on_kept_sides(means, self.kept_sides)
        places = np.flatnonzero(held)
        scale = np.ones(len(places)) if self.orthographic else depth[places]
        focal, centre = (self.camera.fx, self.camera.fy), (self.camera.cx, self.camera.cy)
        held[places] = in_polygon(local[places, :2] / scale[:, None] * focal + centre, self.polygon_px)
        return held

    def transformed(self, similarity: np.ndarray) -> Lasso:
        """The lasso after a (4, 4) similarity of the world."""
        scale = float(np.cbrt(np.linalg.det(similarity[:3, :3])))
        camera = self.camera.transformed(similarity)
        if self.orthographic:
            camera = Camera(
                camera.width,
                camera.height,
                camera.fx / scale,
                camera.fy / scale,
                camera.cx,
                camera.cy,
                camera.world_from_camera,
            )
        return Lasso(
            camera,
            self.polygon_px,
            self.near_m * scale,
            self.far_m * scale,
            self.orthographic,
            self.kept_sides @ np.linalg.inv(similarity),
        )

    def to_json(self) -> dict[str, Any]:
        """As ``region_of`` reads it."""
        return {
            "kind": "lasso",
            "camera": self.camera.to_json(),
            "polygon_px": self.polygon_px.tolist(),
            "near_m": self.near_m,
            "far_m": self.far_m,
            "orthographic": self.orthographic,
            "kept_sides": self.kept_sides.tolist(),
        }


@dataclass(frozen=True)
class Cells:
    """Cells of a grid in the frame ``grid_from_world`` (4, 4), a similarity.

    ``cells`` (K, 3) int64 are the cells' numbers: cell (i, j, k) reaches from i to i + 1 and so on.
    """

    grid_from_world: np.ndarray
    cells: np.ndarray

    @staticmethod
    def around(points: np.ndarray, cell_m: float) -> Cells:
        """The cells of side ``cell_m`` that hold the points (N, 3), metres."""
        grid = np.diag([1.0 / cell_m, 1.0 / cell_m, 1.0 / cell_m, 1.0])
        return Cells(grid, np.unique(cells_of(grid, points), axis=0))

    def holds(self, means: np.ndarray) -> np.ndarray:
        """(N,) bool: which of the points (N, 3), metres, lie in one of the cells."""
        return np.isin(keys_of(cells_of(self.grid_from_world, means)), keys_of(self.cells))

    def transformed(self, similarity: np.ndarray) -> Cells:
        """The cells after a (4, 4) similarity of the world."""
        return Cells(self.grid_from_world @ np.linalg.inv(similarity), self.cells)

    def to_json(self) -> dict[str, Any]:
        """As ``region_of`` reads it."""
        return {"kind": "cells", "grid_from_world": self.grid_from_world.tolist(), "cells": self.cells.tolist()}


Region = Box | Lasso | Cells

KINDS = ("box", "lasso", "cells")


def region_of(data: Mapping[str, Any], where: object) -> Region:
    """The region of ``to_json``. Raises AssetError, with ``where``, when a field is missing or wrong."""
    try:
        match data["kind"]:
            case "box":
                pose = _numbers(data["world_from_box"], (4, 4))
                np.linalg.inv(pose[:3, :3])  # refuses a flat frame
                return Box(pose, _numbers(data["half_extents"], (3,)))
            case "lasso":
                polygon = _numbers(data["polygon_px"], (len(data["polygon_px"]), 2))
                if len(polygon) < 3:
                    raise ValueError("polygon_px has fewer than three corners")
                if len(polygon) > _MOST_CORNERS:
                    raise ValueError(f"polygon_px has more than {_MOST_CORNERS} corners")
                near_m, far_m = _numbers([data["near_m"], data["far_m"]], (2,)).tolist()
                sides = data.get("kept_sides", [])
                return Lasso(
                    Camera.from_json(data["camera"]),
                    polygon,
                    near_m,
                    far_m,
                    bool(data.get("orthographic", False)),
                    _numbers(np.reshape(sides, (-1, 4)), (len(sides), 4)),
                )
            case "cells":
                numbers = np.array(data["cells"], np.float64).reshape(len(data["cells"]), 3)
                if not (np.abs(numbers) < _LARGEST_WHOLE).all() or (numbers != np.rint(numbers)).any():
                    raise ValueError("cells are not whole numbers")
                return Cells(_numbers(data["grid_from_world"], (4, 4)), numbers.astype(np.int64))
            case kind:
                raise ValueError(f"kind is {kind!r}, not one of {', '.join(KINDS)}")
    except (AttributeError, ArithmeticError, KeyError, TypeError, ValueError, np.linalg.LinAlgError) as error:
        what = f"the field {error} is missing" if isinstance(error, KeyError) else str(error)
        raise AssetError(
            f"this is no region: {what}", where=where, cure="See docs/splats.md, Deleting splats."
        ) from error


def _numbers(values: Any, shape: tuple[int, ...]) -> np.ndarray:
    array = np.array(values, np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(f"{shape} finite numbers are needed, not {array.shape}")
    return array


def on_kept_sides(points: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """(N,) bool: which points (N, 3) lie on the positive side of all planes (K, 4): n . x + d > 0."""
    return (points @ sides[:, :3].T + sides[:, 3] > 0.0).all(axis=1)


def in_polygon(points: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """(n,) bool: the points (n, 2) inside a closed polygon (P, 2), by the even-odd rule."""
    points, polygon = np.asarray(points, np.float64), np.asarray(polygon, np.float64)
    lowest, highest = polygon.min(axis=0), polygon.max(axis=0)
    places = np.flatnonzero(((points >= lowest) & (points <= highest)).all(axis=1))
    x, y = points[places].T
    odd = np.zeros(len(places), bool)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if y0 != y1:
            crosses = (y0 > y) != (y1 > y)
            odd ^= crosses & (x < x0 + (y - y0) * ((x1 - x0) / (y1 - y0)))
    inside = np.zeros(len(points), bool)
    inside[places] = odd
    return inside


def cells_of(grid_from_world: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(N, 3) int64: the cell of each point."""
    local = np.asarray(points, np.float64) @ grid_from_world[:3, :3].T + grid_from_world[:3, 3]
    return np.floor(np.clip(local, -_LARGEST_CELL, _LARGEST_CELL - 1)).astype(np.int64)


def keys_of(cells: np.ndarray) -> np.ndarray:
    """(N,) int64: one number for each cell (N, 3)."""
    shifted = np.clip(cells, -_LARGEST_CELL, _LARGEST_CELL - 1) + _LARGEST_CELL
    return (shifted[:, 0] << 42) | (shifted[:, 1] << 21) | shifted[:, 2]
