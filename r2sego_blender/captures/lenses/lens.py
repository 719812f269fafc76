"""Lenses with distortion, and photographs freed of it. Pixel centres are half-integers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from ...core.cameras import Camera, require_pinhole
from ...core.errors import CaptureError
from ...core.images import resize
from .distortion import COEFFICIENTS, distorted, turned, undistorted

# A straightened photograph may grow by this much a side to keep what the lens saw.
_LARGEST_GROWTH = 2.0
_EDGE_SAMPLES = 65
# How far the straightened photograph's border may lie outside the photograph.
_BLANK_PX = 0.6
_LARGEST_COEFFICIENT = 1e12


@dataclass(frozen=True)
class Lens:
    """Intrinsics of a photograph as it was taken, in pixels of its upright file.

    ``distortion`` holds the coefficients of ``model`` (``distortion.COEFFICIENTS``).
    ``border_px`` pixels along each edge of the file show nothing.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    model: str = "opencv"
    border_px: float = 0.0

    def __post_init__(self) -> None:
        if self.model not in COEFFICIENTS:
            raise ValueError(f"{self.model!r} is no model of a lens")

    def require_sensible(self) -> None:
        """Raises ValueError unless something can be seen through it: for numbers that files tell."""
        require_pinhole(self.width, self.height, self.fx, self.fy, self.cx, self.cy)
        if not all(abs(k) <= _LARGEST_COEFFICIENT for k in self.distortion):
            raise ValueError("a lens has no such distortion")
        if not 0.0 <= 2.0 * self.border_px < min(self.width, self.height):
            raise ValueError(f"a photograph has no border of {self.border_px:.6g} pixels")

    @property
    def distorts(self) -> bool:
        """Whether the lens is anything but a pinhole."""
        return self.model != "opencv" or any(self.distortion)

    @property
    def plain(self) -> bool:
        """Whether the photograph is already what a pinhole camera sees, whole."""
        return not self.distorts and not self.border_px

    @property
    def matrix(self) -> np.ndarray:
        """(3, 3) float64, the intrinsic matrix."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def scaled_to(self, width: int, height: int) -> Lens:
        """The same lens for photographs of another size."""
        sx, sy = width / self.width, height / self.height
        return replace(
            self,
            width=width,
            height=height,
            fx=self.fx * sx,
            fy=self.fy * sy,
            cx=self.cx * sx,
            cy=self.cy * sy,
            border_px=self.border_px * max(sx, sy),
        )

    def turned(self, quarter_turns: int) -> Lens:
        """The lens of the photograph turned clockwise by quarter turns."""
        lens = self
        for _ in range(quarter_turns % 4):
            lens = Lens(
                lens.height,
                lens.width,
                lens.fy,
                lens.fx,
                lens.height - lens.cy,
                lens.cx,
                turned(lens.model, lens.distortion),
                lens.model,
                lens.border_px,
            )
        return lens

    def project(self, rays: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) in the photograph of camera-frame rays (n, 2) with z = 1."""
        rays = np.asarray(rays, np.float64).reshape(-1, 2)
        if self.distorts:
            rays = distorted(self.model, self.distortion, rays)
        return rays * [self.fx, self.fy] + [self.cx, self.cy]

    def rays(self, pixels: np.ndarray) -> np.ndarray:
        """Camera-frame rays (n, 2) with z = 1 of pixels (n, 2) in the photograph."""
        places = (np.asarray(pixels, np.float64).reshape(-1, 2) - [self.cx, self.cy]) / [self.fx, self.fy]
        return undistorted(self.model, self.distortion, places) if self.distorts else places

    def straight(self, world_from_camera: np.ndarray) -> Camera:
        """The pinhole camera of the straightened photograph at a pose.

        Its focal lengths are the lens's own; its image is the largest upright rectangle
        without blank pixels, so size and principal point may differ from the photograph's.
        Raises CaptureError for a distortion that leaves no such rectangle.
        """
        if self.plain:
            return Camera(self.width, self.height, self.fx, self.fy, self.cx, self.cy, world_from_camera)
        margin = self.border_px
        x = np.linspace(margin, self.width - margin, _EDGE_SAMPLES)
        y = np.linspace(margin, self.height - margin, _EDGE_SAMPLES)
        left, right = (self._straightened(np.full_like(y, at), y)[:, 0] for at in (x[0], x[-1]))
        top, bottom = (self._straightened(x, np.full_like(x, at))[:, 1] for at in (y[0], y[-1]))
        edges = np.array([left.max(), top.max(), right.min(), bottom.min()])
        if self.model not in ("opencv", "brown"):
            # What a fisheye sees beyond a right angle has no place and bounds nothing.
            edges = np.array([np.fmax.reduce(left), np.fmax.reduce(top), np.fmin.reduce(right), np.fmin.reduce(bottom)])
            edges = np.where(np.isnan(edges), [-np.inf, -np.inf, np.inf, np.inf], edges)
        elif not np.isfinite(edges).all():
            edges = np.zeros(4)
        reach_x, reach_y = self.width * (_LARGEST_GROWTH - 1) / 2, self.height * (_LARGEST_GROWTH - 1) / 2
        x0 = int(np.ceil(max(edges[0], -reach_x) - 1e-6))
        y0 = int(np.ceil(max(edges[1], -reach_y) - 1e-6))
        x1 = int(np.floor(min(edges[2], self.width + reach_x) + 1e-6))
        y1 = int(np.floor(min(edges[3], self.height + reach_y) + 1e-6))
        straight = Camera(x1 - x0, y1 - y0, self.fx, self.fy, self.cx - x0, self.cy - y0, world_from_camera)
        if min((x1 - x0) / self.width, (y1 - y0) / self.height) < 1 / 8 or self._leaves_blank(straight):
            raise CaptureError(
                f"the distortion {self.distortion} cannot be undone",
                where="camera distortion",
                cure="Check k1, k2, p1, p2, or give undistorted photographs.",
            )
        return straight

    def straightened(self, photograph: np.ndarray, longest_px: int | None = None) -> np.ndarray:
        """The photograph (H, W) or (H, W, 3) as ``straight``'s camera sees it, float32.

        With ``longest_px`` it is scaled down first, for 48 megapixels would take 20 GB.
        """
        camera, lens = self.straight(np.eye(4)), self
        if longest_px is not None and max(camera.width, camera.height) > longest_px:
            share = longest_px / max(camera.width, camera.height)
            camera = camera.fitted(longest_px)
            lens = self.scaled_to(round(self.width * share), round(self.height * share))
            photograph = resize(photograph, lens.width, lens.height)
        rays = camera.rays()[..., :2].reshape(-1, 2)
        # OpenCV counts pixel centres from zero.
        source = (lens.project(rays) - 0.5).astype(np.float32).reshape(*camera.shape, 2)
        straight = cv2.remap(
            photograph.astype(np.float32),
            source[..., 0],
            source[..., 1],
            cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REPLICATE,
        )
        return np.clip(straight, 0.0, 1.0)

    def to_json(self) -> dict[str, Any]:
        """A JSON-ready dict; ``from_json`` reads it back without loss."""
        return {
            "width": self.width,
            "height": self.height,
            "fx": self.fx,
            "fy": self.fy,
            "cx": self.cx,
            "cy": self.cy,
            "distortion": list(self.distortion),
            "distortion_model": self.model,
            "border_px": self.border_px,
        }

    @staticmethod
    def from_json(data: dict[str, Any]) -> Lens:
        """The lens of ``to_json``. Raises KeyError, TypeError or ValueError for anything else."""
        model = "opencv_fisheye" if data.get("fisheye") else "opencv"  # bundles before distortion_model
        fx, fy, cx, cy = (float(data[key]) for key in ("fx", "fy", "cx", "cy"))
        lens = Lens(
            int(data["width"]),
            int(data["height"]),
            fx,
            fy,
            cx,
            cy,
            tuple(float(k) for k in data.get("distortion", ())),
            str(data.get("distortion_model", model)),
            float(data.get("border_px", 0.0)),
        )
        lens.require_sensible()
        return lens

    def _straightened(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        rays = self.rays(np.stack([x, y], axis=1))
        # Beyond the radius at which a polynomial folds back, inversion finds another ray.
        honest = np.abs(self.project(rays) - np.stack([x, y], axis=1)).max(axis=1) < 0.01
        rays = np.where(honest[:, None], rays, np.nan)
        return rays * [self.fx, self.fy] + [self.cx, self.cy]

    def _leaves_blank(self, straight: Camera) -> bool:
        """Whether the border of the straightened photograph shows what the photograph does not."""
        share = np.linspace(0.0, 1.0, _EDGE_SAMPLES)
        ends = np.zeros_like(share), np.ones_like(share)
        border = np.concatenate([np.stack(pair, axis=1) for end in ends for pair in ((share, end), (end, share))]) * [
            straight.width,
            straight.height,
        ]
        pixels = self.project((border - [straight.cx, straight.cy]) / [straight.fx, straight.fy])
        return not ((pixels > -_BLANK_PX) & (pixels < np.array([self.width, self.height]) + _BLANK_PX)).all()
