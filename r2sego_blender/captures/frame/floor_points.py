"""The ground as a person gives it: floor points shown in photographs, or a direction and a height."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeVar

import numpy as np

from ...core.errors import CaptureError
from ...core.progress import SILENT, Progress
from .ground import Ground
from .lifting import Sparse, View, intersection, intersection_covariance, lifted, pointed_at

if TYPE_CHECKING:
    from ..capture import Capture

_UP = np.array([0.0, 0.0, 1.0])
# Three points must span this share of their distance from the cameras across their longest line.
_THINNEST = 0.05
_FARTHEST_OFF_M = 0.05
# How far a point may be seen from where it was shown, as a share of the image's longest side.
_FARTHEST_SHOWN = 0.01
_WHERE = "floor points"
# How surely a person points, a surface spans a pixel (share of its distance) and a floor is flat.
_SHOWN_SIGMA_PX, _LIFTED_SIGMA, _FLOOR_SIGMA_M = 1.0, 0.02, 0.003
_FITS = 5
_UNSURE_DEG = 1.0

Seen = TypeVar("Seen", bound=View, contravariant=True)


class Placeable(Protocol[Seen]):
    """A point that ``ground_through`` can place in captures of a kind."""

    def place(self, captures: Sequence[Seen], sparse: Sparse) -> tuple[np.ndarray, np.ndarray]: ...


@dataclass(frozen=True)
class FloorPoint:
    """A point of the floor: its pixel in one photograph, or in several for a surer place.

    ``views`` are (photograph, (x, y)) with pixels of the capture's upright file.
    """

    views: tuple[tuple[str, tuple[float, float]], ...]

    @staticmethod
    def parse(text: str) -> FloorPoint:
        """The point of ``PHOTO:X,Y`` or ``PHOTO:X,Y=PHOTO:X,Y``. Raises CaptureError for another."""
        views = []
        try:
            for view in text.split("="):
                photo, pixel = view.rsplit(":", 1)
                x, y = map(float, pixel.split(","))
                views.append((photo, (x, y)))
        except ValueError as error:
            raise CaptureError(
                f"'{text}' is not PHOTO:X,Y or PHOTO:X,Y=PHOTO:X,Y",
                where=_WHERE,
                cure="For example IMG_01:320,410=IMG_03:122,388, the same spot in two photographs.",
            ) from error
        return FloorPoint(tuple(views))

    def place(self, captures: Sequence[Capture], sparse: Sparse) -> tuple[np.ndarray, np.ndarray]:
        """Where the point is (3,), in the captures' frame, and its (3, 3) covariance.

        From one photograph it lies on the surface that the nearest sparse points span, from
        several where their rays meet.
        """
        shown = [pointed_at(captures, photo, [pixel], _WHERE) for photo, pixel in self.views]
        if len(shown) == 1:
            index, (pixel,) = shown[0]
            point = lifted(captures[index], sparse, index, pixel)
            distance = float(np.linalg.norm(point - captures[index].camera.centre))
            return point, (_LIFTED_SIGMA * distance) ** 2 * np.eye(3)
        cameras = [captures[index].camera for index, _ in shown]
        pixels = [pixels[0] for _, pixels in shown]
        point = intersection(cameras, pixels)
        for camera, pixel, (photo, _) in zip(cameras, pixels, self.views, strict=True):
            place, depth = camera.project(point)
            off_px = float(np.linalg.norm(place - pixel))
            if depth <= 0 or off_px > _FARTHEST_SHOWN * max(camera.width, camera.height):
                raise CaptureError(
                    f"the photographs do not show one point: it would lie {off_px:.0f} pixels away in {photo}",
                    where=f"{_WHERE}, {self}",
                    cure="Show the same spot in each of them.",
                )
        return point, intersection_covariance(cameras, pixels, point, _SHOWN_SIGMA_PX)

    def __str__(self) -> str:
        return "=".join(f"{photo}:{x:g},{y:g}" for photo, (x, y) in self.views)


def ground_through(
    captures: Sequence[Seen], sparse: Sparse, shown: Sequence[Placeable[Seen]], progress: Progress = SILENT
) -> Ground:
    """The ground through floor points, for captures in the world frame.

    Three points or more give gravity too; one or two the height of the floor alone. Each
    counts by how surely its photographs place it. A tilt that they leave unsure is a warning.
    Raises CaptureError when they lie in a line, far off one plane, or not below the cameras.
    """
    placed = [point.place(captures, sparse) for point in shown]
    points, covariances = (np.array(values) for values in zip(*placed, strict=True))
    cameras = np.array([capture.camera.centre for capture in captures])
    count = len(points)
    if count < 3:
        weights = 1.0 / _variances(covariances, _UP)
        height = float(weights @ points @ _UP / weights.sum())
        sure_m = weights.sum() ** -0.5
        what = f"height of {count} floor point{'s' if count > 1 else ''} shown, sure to {sure_m * 100:.1f} cm"
        return _below(captures, Ground(_UP, height, count, True, what))
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    away = cameras.mean(axis=0) - points.mean(axis=0)
    if np.ptp(points @ axes[1]) < _THINNEST * np.linalg.norm(away):
        raise CaptureError(
            f"the {count} floor points lie almost in one line",
            where=_WHERE,
            cure="Show points far apart that span a triangle.",
        )
    for _ in range(_FITS):
        weights = 1.0 / _variances(covariances, axes[2])
        centre = weights @ points / weights.sum()
        _, _, axes = np.linalg.svd(np.sqrt(weights)[:, None] * (points - centre), full_matrices=False)
    normal = axes[2] * (1.0 if away @ axes[2] > 0 else -1.0)
    off = np.abs((points - centre) @ normal)
    if (off > _FARTHEST_OFF_M + 3.0 / np.sqrt(weights)).any():
        raise CaptureError(
            f"the {count} floor points lie up to {off.max():.2f} m off one plane",
            where=_WHERE,
            cure="Show each in two photographs, on the floor itself and not through glass or a mirror.",
        )
    design = np.column_stack([(points - centre) @ axes[:2].T, np.ones(count)])
    covariance = np.linalg.inv(design.T @ (weights[:, None] * design))
    tilt_deg = float(np.degrees(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1])))
    if tilt_deg > _UNSURE_DEG:
        progress.message(
            f"the floor points tell the tilt to {tilt_deg:.1f} degrees only: show them further apart, in "
            "photographs from places further apart; or one point alone, which keeps up as it is",
            level="warning",
        )
    what = f"plane through {count} floor points shown, tilt sure to {tilt_deg:.1f} degrees"
    return _below(captures, Ground(normal, float(normal @ centre), count, True, what))


def _variances(covariances: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(n,) of points along a normal."""
    return np.einsum("i,nij,j->n", normal, covariances, normal) + _FLOOR_SIGMA_M**2


def ground_of(captures: Sequence[Capture], up: Sequence[float] | None, height_m: float) -> Ground:
    """The ground with direction ``up`` (3,), else up as it is, ``height_m`` above the world's origin."""
    normal = _UP if up is None else np.asarray(up, np.float64)
    length = float(np.linalg.norm(normal))
    if normal.shape != (3,) or not (np.isfinite(length) and length > 0) or not np.isfinite(height_m):
        raise CaptureError(
            f"{up} and {height_m} are no direction and height",
            where="ground",
            cure="Give three numbers that are not all zero, and metres.",
        )
    normal = normal / length
    what = f"given by hand: up was ({', '.join(f'{v:.4f}' for v in normal)}), {height_m:+.3f} m"
    return _below(captures, Ground(normal, height_m * normal[2], 0, True, what))


def _below(captures: Sequence[View], ground: Ground) -> Ground:
    lowest = min(captures, key=lambda capture: float(ground.height(capture.camera.centre)))
    if not ground.height(lowest.camera.centre) > 0:
        raise CaptureError(
            f"the ground would lie above the camera of {lowest.name}",
            where="ground",
            cure="Show points of the floor, and give up as the direction away from it.",
        )
    return ground
