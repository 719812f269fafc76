"""Lenses with distortion, and photographs freed of it.

Distortion is OpenCV's: ``(k1, k2, p1, p2, k3, k4, k5, k6)`` on normalised coordinates,
or, for a fisheye, ``(k1, k2, k3, k4)`` on the angle. Pixel centres are half-integers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from ..cameras import Camera
from ..errors import CaptureError

# A straightened photograph may grow by this much a side to keep what the lens saw.
_LARGEST_GROWTH = 2.0
_ITERATIONS = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)


@dataclass(frozen=True)
class Lens:
    """Intrinsics of a photograph as it was taken, in pixels of its upright file."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    fisheye: bool = False

    @property
    def distorts(self) -> bool:
        """Whether the lens is anything but a pinhole."""
        return self.fisheye or any(self.distortion)

    @property
    def matrix(self) -> np.ndarray:
        """(3, 3) float64, the intrinsic matrix."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def scaled_to(self, width: int, height: int) -> Lens:
        """The same lens for photographs of another size."""
        sx, sy = width / self.width, height / self.height
        return replace(
            self, width=width, height=height,
            fx=self.fx * sx, fy=self.fy * sy, cx=self.cx * sx, cy=self.cy * sy,
        )  # fmt: skip

    def turned(self, quarter_turns: int) -> Lens:
        """The lens of the photograph turned clockwise by quarter turns."""
        lens = self
        for _ in range(quarter_turns % 4):
            distortion = list(lens.distortion)
            if not lens.fisheye and len(distortion) >= 4:
                # The tangential terms act along (p2, p1), which turns with the image.
                distortion[2], distortion[3] = distortion[3], -distortion[2]
            lens = Lens(
                lens.height, lens.width, lens.fy, lens.fx, lens.height - lens.cy, lens.cx,
                tuple(distortion), lens.fisheye,
            )  # fmt: skip
        return lens

    def project(self, rays: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) in the photograph of camera-frame rays (n, 2) with z = 1."""
        points = np.asarray(rays, np.float64).reshape(-1, 1, 2)
        if self.fisheye:
            distorted = cv2.fisheye.distortPoints(points, np.eye(3), self._coefficients()).reshape(-1, 2)
        else:
            solid = np.concatenate([points, np.ones((len(points), 1, 1))], axis=2)
            projected, _ = cv2.projectPoints(
                solid, np.zeros(3), np.zeros(3), np.eye(3), self._coefficients()
            )  # fmt: skip
            distorted = projected.reshape(-1, 2)
        return distorted * [self.fx, self.fy] + [self.cx, self.cy]

    def rays(self, pixels: np.ndarray) -> np.ndarray:
        """Camera-frame rays (n, 2) with z = 1 of pixels (n, 2) in the photograph."""
        points = np.asarray(pixels, np.float64).reshape(-1, 1, 2)
        if not self.distorts:
            return (points.reshape(-1, 2) - [self.cx, self.cy]) / [self.fx, self.fy]
        if self.fisheye:
            found = cv2.fisheye.undistortPoints(
                points, self.matrix, self._coefficients(), criteria=_ITERATIONS
            )  # fmt: skip
        else:
            found = cv2.undistortPointsIter(
                points, self.matrix, self._coefficients(), np.eye(3), np.eye(3), _ITERATIONS
            )
        return found.reshape(-1, 2)

    def straight(self, world_from_camera: np.ndarray) -> Camera:
        """The pinhole camera of the straightened photograph at a pose.

        Its focal lengths are the lens's own; its image is the largest upright rectangle
        without blank pixels, so size and principal point may differ from the photograph's.
        Raises CaptureError for a distortion that leaves no such rectangle.
        """
        if not self.distorts:
            return Camera(
                self.width, self.height, self.fx, self.fy, self.cx, self.cy, world_from_camera
            )  # fmt: skip
        x = np.linspace(0.0, self.width, 65)
        y = np.linspace(0.0, self.height, 65)
        left, right = self._straightened(np.zeros(65), y), self._straightened(np.full(65, self.width), y)
        top, bottom = self._straightened(x, np.zeros(65)), self._straightened(x, np.full(65, self.height))
        edges = (left[:, 0].max(), top[:, 1].max(), right[:, 0].min(), bottom[:, 1].min())
        if not np.isfinite(edges).all():
            edges = (0.0, 0.0, 0.0, 0.0)
        reach_x, reach_y = self.width * (_LARGEST_GROWTH - 1) / 2, self.height * (_LARGEST_GROWTH - 1) / 2
        x0 = int(np.ceil(max(edges[0], -reach_x) - 1e-6))
        y0 = int(np.ceil(max(edges[1], -reach_y) - 1e-6))
        x1 = int(np.floor(min(edges[2], self.width + reach_x) + 1e-6))
        y1 = int(np.floor(min(edges[3], self.height + reach_y) + 1e-6))
        if x1 - x0 < self.width / 8 or y1 - y0 < self.height / 8:
            raise CaptureError(
                f"the distortion {self.distortion} cannot be undone", where="camera distortion",
                cure="Check k1, k2, p1, p2, or give undistorted photographs.",
            )  # fmt: skip
        return Camera(x1 - x0, y1 - y0, self.fx, self.fy, self.cx - x0, self.cy - y0, world_from_camera)

    def straightened(self, photograph: np.ndarray) -> np.ndarray:
        """The photograph (H, W, 3) as ``straight``'s camera sees it, float32."""
        camera = self.straight(np.eye(4))
        rays = camera.rays()[..., :2].reshape(-1, 2)
        # OpenCV counts pixel centres from zero.
        source = (self.project(rays) - 0.5).astype(np.float32).reshape(*camera.shape, 2)
        straight = cv2.remap(
            photograph.astype(np.float32), source[..., 0], source[..., 1],
            cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE,
        )  # fmt: skip
        return np.clip(straight, 0.0, 1.0)

    def to_json(self) -> dict[str, Any]:
        """A JSON-ready dict; ``from_json`` reads it back without loss."""
        return {
            "width": self.width, "height": self.height, "fx": self.fx, "fy": self.fy,
            "cx": self.cx, "cy": self.cy, "distortion": list(self.distortion), "fisheye": self.fisheye,
        }  # fmt: skip

    @staticmethod
    def from_json(data: dict[str, Any]) -> Lens:
        """The lens of ``to_json``."""
        numbers = (float(data[key]) for key in ("fx", "fy", "cx", "cy"))
        return Lens(
            int(data["width"]), int(data["height"]), *numbers,
            tuple(float(k) for k in data.get("distortion", ())), bool(data.get("fisheye", False)),
        )  # fmt: skip

    def _straightened(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        rays = self.rays(np.stack([x, y], axis=1))
        # Beyond the radius at which a polynomial folds back, inversion finds another ray.
        honest = np.abs(self.project(rays) - np.stack([x, y], axis=1)).max(axis=1) < 0.01
        rays = np.where(honest[:, None], rays, np.nan)
        return rays * [self.fx, self.fy] + [self.cx, self.cy]

    def _coefficients(self) -> np.ndarray:
        count = 4 if self.fisheye else 8
        return np.array((*self.distortion, *[0.0] * count)[:count], np.float64)
