"""Pinhole cameras: intrinsics in pixels and a ``world_from_camera`` pose.

Conventions (docs/conventions.md): OpenCV axes (x right, y down, z forward), metres,
pixel centres at half-integers, depth is planar z.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from .image_sizes import LONGEST_SIDE_PX, MOST_PX

RIGID_CURE = "Give a 4x4 rigid matrix without scale or mirroring, last row 0 0 0 1."
"""What to do about a pose that is not."""

_LONGEST_FOCAL_PX = 1e8
_FARTHEST_CENTRE_PX = 1e8
_RIGID_TOLERANCE = 1e-3
_FARTHEST = 1e12
"""Of a camera from the origin, in any unit; beyond it differences of places are none."""

_IDENTITY = np.eye(3)
_LAST_ROW = np.zeros((4, 4))
_LAST_ROW[3, 3] = 1.0
_RIGID_BOUNDS = np.array([[2.0, 2.0, 2.0, _FARTHEST]] * 3 + [[1e-6] * 4])


class NotRigidError(ValueError):
    """A camera's pose that is more than a rotation and a translation."""


def is_rigid(pose: np.ndarray) -> bool:
    """Whether (4, 4) is a rotation and a translation, as near as files have them: no scale, no mirroring.

    Of (n, 4, 4) whether all are.
    """
    # Nothing infinite or beyond all bounds is multiplied, and comparisons with NaN fail.
    if not (np.abs(pose - _LAST_ROW) <= _RIGID_BOUNDS).all():
        return False
    rotation = pose[..., :3, :3]
    skew = np.abs(rotation.swapaxes(-1, -2) @ rotation - _IDENTITY)
    return bool((skew <= _RIGID_TOLERANCE).all() and (np.linalg.det(rotation) > 0.0).all())


def require_pinhole(width: float, height: float, fx: float, fy: float, cx: float, cy: float) -> None:
    """Raises ValueError unless a lens of these pixels can see something: for numbers that files tell."""
    if not (1 <= width <= LONGEST_SIDE_PX and 1 <= height <= LONGEST_SIDE_PX and width * height <= MOST_PX):
        raise ValueError(f"a camera has no {width:.6g} x {height:.6g} pixels")
    if not (0.0 < fx <= _LONGEST_FOCAL_PX and 0.0 < fy <= _LONGEST_FOCAL_PX):
        raise ValueError(f"a camera has no focal lengths of {fx:.6g} and {fy:.6g} pixels")
    if not (abs(cx) <= _FARTHEST_CENTRE_PX and abs(cy) <= _FARTHEST_CENTRE_PX):
        raise ValueError(f"a camera has no principal point at {cx:.6g}, {cy:.6g}")


def is_similarity(matrix: np.ndarray) -> bool:
    """Whether (4, 4) is a rotation, a translation and one scale above 0, as near as files have them."""
    if not (np.abs(matrix) <= _FARTHEST).all():
        return False
    scale = np.cbrt(np.linalg.det(matrix[:3, :3]))
    return bool(scale > 1.0 / _FARTHEST) and is_rigid(matrix / np.array([[scale], [scale], [scale], [1.0]]))


@dataclass(frozen=True)
class Camera:
    """A pinhole camera at a pose.

    ``world_from_camera`` is (4, 4) float64, a rigid transform in OpenCV axes;
    ``fx, fy, cx, cy`` are in pixels, the first pixel's centre lies at (0.5, 0.5).
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    world_from_camera: np.ndarray

    def __post_init__(self) -> None:
        pose = np.array(self.world_from_camera, dtype=np.float64)
        if pose.shape != (4, 4) or not np.isfinite(pose).all():
            raise ValueError("world_from_camera must be a finite 4x4 matrix")
        object.__setattr__(self, "world_from_camera", pose)

    def checked(self) -> Camera:
        """This camera, of numbers that a file told.

        Raises ValueError where it can see nothing, NotRigidError of these for its pose.
        """
        require_pinhole(self.width, self.height, self.fx, self.fy, self.cx, self.cy)
        if not is_rigid(self.world_from_camera):
            raise NotRigidError("the pose is not a rotation and a translation")
        return self

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Itself as ``lens`` (6,) and ``world_from_camera`` (4, 4) of an array file."""
        lens = np.array([self.width, self.height, self.fx, self.fy, self.cx, self.cy])
        return {"lens": lens, "world_from_camera": self.world_from_camera}

    @staticmethod
    def from_arrays(arrays: Mapping[str, np.ndarray]) -> Camera:
        """What ``to_arrays`` gave, ``checked``. Raises KeyError or ValueError for anything else."""
        width, height, fx, fy, cx, cy = arrays["lens"].tolist()
        return Camera(int(width), int(height), fx, fy, cx, cy, arrays["world_from_camera"]).checked()

    @cached_property
    def camera_from_world(self) -> np.ndarray:
        """(4, 4) float64, the inverse rigid transform; not to be written to."""
        rotation = self.world_from_camera[:3, :3]
        inverse = np.eye(4)
        inverse[:3, :3] = rotation.T
        inverse[:3, 3] = -rotation.T @ self.world_from_camera[:3, 3]
        inverse.flags.writeable = False
        return inverse

    @property
    def centre(self) -> np.ndarray:
        """(3,) float64, the optical centre in the world, metres."""
        return self.world_from_camera[:3, 3]

    @property
    def forward(self) -> np.ndarray:
        """(3,) float64, the unit viewing direction in the world."""
        return self.world_from_camera[:3, 2]

    @property
    def matrix(self) -> np.ndarray:
        """(3, 3) float64, the intrinsic matrix K."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width), the shape of this camera's images."""
        return self.height, self.width

    def at(self, world_from_camera: np.ndarray) -> Camera:
        """The same lens at another pose."""
        return replace(self, world_from_camera=world_from_camera)

    def scaled(self, factor: float) -> Camera:
        """The same view with ``round(size * factor)`` pixels a side."""
        width = max(1, round(self.width * factor))
        height = max(1, round(self.height * factor))
        sx, sy = width / self.width, height / self.height
        return replace(
            self, width=width, height=height, fx=self.fx * sx, fy=self.fy * sy, cx=self.cx * sx, cy=self.cy * sy
        )

    def fitted(self, max_side_px: int) -> Camera:
        """This camera, scaled down so that no side is longer than ``max_side_px``."""
        longest = max(self.width, self.height)
        return self if longest <= max_side_px else self.scaled(max_side_px / longest)

    def transformed(self, similarity: np.ndarray) -> Camera:
        """This camera after a (4, 4) similarity (scale, rotation, translation) of the world."""
        scale = np.cbrt(np.linalg.det(similarity[:3, :3]))
        pose = similarity @ self.world_from_camera
        pose[:3, :3] /= scale
        return self.at(pose)

    def rays(self) -> np.ndarray:
        """(H, W, 3) float64, each pixel's ray in the camera frame with z = 1."""
        u = (np.arange(self.width) + 0.5 - self.cx) / self.fx
        v = (np.arange(self.height) + 0.5 - self.cy) / self.fy
        rays = np.ones((self.height, self.width, 3))
        rays[..., 0] = u[None, :]
        rays[..., 1] = v[:, None]
        return rays

    def unproject(self, depth: np.ndarray) -> np.ndarray:
        """World points (H, W, 3) float64 of a planar depth map (H, W) in metres."""
        local = self.rays() * np.asarray(depth, np.float64)[..., None]
        points: np.ndarray = local @ self.world_from_camera[:3, :3].T + self.centre
        return points

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (..., 2) and planar depth (...,) of world points (..., 3), float64.

        Points at or behind the camera plane have a depth <= 0 and meaningless pixels.
        """
        transform = self.camera_from_world
        local = np.asarray(points, np.float64) @ transform[:3, :3].T + transform[:3, 3]
        depth = local[..., 2]
        safe = np.where(depth > 1e-9, depth, 1e-9)
        u = local[..., 0] / safe * self.fx + self.cx
        v = local[..., 1] / safe * self.fy + self.cy
        return np.stack([u, v], axis=-1), depth

    def sees(self, pixels: np.ndarray, depth: np.ndarray, margin_px: float = 0.0) -> np.ndarray:
        """(...,) bool: which projections lie in front and inside the image, less a margin."""
        u, v = pixels[..., 0], pixels[..., 1]
        inside = (u >= margin_px) & (u < self.width - margin_px)
        inside &= (v >= margin_px) & (v < self.height - margin_px)
        return inside & (depth > 0.0)

    def to_json(self) -> dict[str, Any]:
        """A JSON-ready dict; ``from_json`` reads it back without loss."""
        return {
            "width": self.width,
            "height": self.height,
            "fx": self.fx,
            "fy": self.fy,
            "cx": self.cx,
            "cy": self.cy,
            "world_from_camera": self.world_from_camera.tolist(),
        }

    @staticmethod
    def from_json(data: dict[str, Any]) -> Camera:
        """The camera of ``to_json``, ``checked``; extra keys are ignored. Raises ValueError, as data of none do."""
        return Camera(
            width=int(data["width"]),
            height=int(data["height"]),
            fx=float(data["fx"]),
            fy=float(data["fy"]),
            cx=float(data["cx"]),
            cy=float(data["cy"]),
            world_from_camera=np.array(data["world_from_camera"], np.float64),
        ).checked()


def look_at(centre: np.ndarray, target: np.ndarray, up: np.ndarray | Sequence[float] = (0.0, 0.0, 1.0)) -> np.ndarray:
    """``world_from_camera`` (4, 4) of an upright camera at ``centre`` looking at ``target``."""
    forward = np.asarray(target, np.float64) - np.asarray(centre, np.float64)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = right, np.cross(forward, right), forward
    pose[:3, 3] = centre
    return pose


def rotation_angle_rad(a: np.ndarray, b: np.ndarray) -> float:
    """The angle between two poses' or matrices' (>= 3, >= 3) rotations, radians."""
    trace = np.trace(a[:3, :3].T @ b[:3, :3])
    return float(np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)))
