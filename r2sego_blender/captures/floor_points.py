"""The ground as a person gives it: floor points shown in photographs, or a direction and a height."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import CaptureError
from .capture import Capture
from .ground import Ground
from .lifting import intersection, lifted, pointed_at
from .sparse import SparsePoints

_UP = np.array([0.0, 0.0, 1.0])
# Three points must span this share of their distance from the cameras across their longest line.
_THINNEST = 0.05
_FARTHEST_OFF_M = 0.1
_WHERE = "floor points"


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
                f"'{text}' is not PHOTO:X,Y or PHOTO:X,Y=PHOTO:X,Y", where=_WHERE,
                cure="For example IMG_01:320,410=IMG_03:122,388, the same spot in two photographs.",
            ) from error  # fmt: skip
        return FloorPoint(tuple(views))

    def place(self, captures: Sequence[Capture], sparse: SparsePoints) -> np.ndarray:
        """Where the point is (3,), in the captures' frame.

        From one photograph it lies on the surface that the nearest sparse points span, from
        several where their rays meet.
        """
        shown = [pointed_at(captures, photo, [pixel], _WHERE) for photo, pixel in self.views]
        if len(shown) == 1:
            index, pixels = shown[0]
            return lifted(captures[index], sparse, index, pixels[0])
        return intersection([captures[i].camera for i, _ in shown], [pixels[0] for _, pixels in shown])


def ground_through(
    captures: Sequence[Capture], sparse: SparsePoints, shown: Sequence[FloorPoint]
) -> Ground:  # fmt: skip
    """The ground through floor points, for captures in the world frame.

    Three points or more give gravity too; one or two the height of the floor alone. Raises
    CaptureError when they lie in a line, far off one plane, or not below the cameras.
    """
    points = np.array([point.place(captures, sparse) for point in shown])
    centre = points.mean(axis=0)
    cameras = np.array([capture.camera.centre for capture in captures])
    if len(points) < 3:
        normal, what = _UP, f"height of {len(points)} floor point{'s' if len(points) > 1 else ''} shown"
    else:
        _, _, axes = np.linalg.svd(points - centre, full_matrices=False)
        across = (points - centre) @ axes[1]
        if np.ptp(across) < _THINNEST * np.linalg.norm(cameras.mean(axis=0) - centre):
            raise CaptureError(
                f"the {len(points)} floor points lie almost in one line", where=_WHERE,
                cure="Show points far apart that span a triangle.",
            )  # fmt: skip
        normal = axes[2] * (1.0 if (cameras.mean(axis=0) - centre) @ axes[2] > 0 else -1.0)
        off_m = float(np.abs((points - centre) @ normal).max())
        what = f"plane through {len(points)} floor points shown"
        if len(points) > 3:
            what += f", {off_m * 100:.1f} cm off it at most"
        if off_m > _FARTHEST_OFF_M:
            raise CaptureError(
                f"the {len(points)} floor points lie up to {off_m:.2f} m off one plane", where=_WHERE,
                cure="Show each in two photographs, on the floor itself and not through glass or a mirror.",
            )  # fmt: skip
    return _below(captures, Ground(normal, float(normal @ centre), len(points), True, what))


def ground_of(captures: Sequence[Capture], up: Sequence[float] | None, height_m: float) -> Ground:
    """The ground with direction ``up`` (3,), else up as it is, ``height_m`` above the world's origin."""
    normal = _UP if up is None else np.asarray(up, np.float64)
    length = float(np.linalg.norm(normal))
    if normal.shape != (3,) or not (np.isfinite(length) and length > 0) or not np.isfinite(height_m):
        raise CaptureError(
            f"{up} and {height_m} are no direction and height", where="ground",
            cure="Give three numbers that are not all zero, and metres.",
        )  # fmt: skip
    normal = normal / length
    what = f"given by hand: up was ({', '.join(f'{v:.4f}' for v in normal)}), {height_m:+.3f} m"
    return _below(captures, Ground(normal, height_m * normal[2], 0, True, what))


def _below(captures: Sequence[Capture], ground: Ground) -> Ground:
    lowest = min(captures, key=lambda capture: float(ground.height(capture.camera.centre)))
    if not ground.height(lowest.camera.centre) > 0:
        raise CaptureError(
            f"the ground would lie above the camera of {lowest.name}", where="ground",
            cure="Show points of the floor, and give up as the direction away from it.",
        )  # fmt: skip
    return ground
