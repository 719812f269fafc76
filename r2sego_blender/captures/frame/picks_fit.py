"""The ground and scale that fit a person's picks best, and what they leave unexplained.

The same arithmetic answers in Blender, where the residuals are shown before anything is
moved, and in the engine, which moves the scene. NumPy alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.cameras import Camera
from ...core.errors import CaptureError
from ...core.progress import SILENT, Progress
from .floor_points import ground_through
from .ground import Ground
from .lifting import Sparse, View, intersection, lifted
from .picks import WHERE, CameraHeight, Pick, PickedPoint, Picks

# How surely a person clicks and measures, and a single photograph places a point (share of its distance).
_PICK_SIGMA_PX, _TAPE_SIGMA_M, _LIFTED_SIGMA = 1.0, 0.005, 0.02
_HEIGHT_SIGMA_M = 0.01
# Beyond these a pick or a length is a mistake and no error of measurement.
_FARTHEST_PICKED = 0.01  # of the image's longest side
_WORST_LENGTH = 0.1  # of the length
_REFINEMENTS = 5


@dataclass(frozen=True)
class PlacedPoint:
    """A picked point in the world of now.

    ``position`` (3,) and ``covariance`` (3, 3) in metres of now; ``off_px`` (n,): how far from
    each pick the point is seen, NaN where one photograph alone places it; ``off_share`` (n,): the
    same as a share of the image's longest side.
    """

    point: PickedPoint
    position: np.ndarray
    covariance: np.ndarray
    off_px: np.ndarray
    off_share: np.ndarray

    def place(self, captures: Sequence[View], sparse: Sparse) -> tuple[np.ndarray, np.ndarray]:
        """As a floor point of ``ground_through``."""
        return self.position, self.covariance


@dataclass(frozen=True)
class PicksFit:
    """The ground and the scale that fit the picks best, and what they leave unexplained.

    ``ground`` is in the world of now, None without floor points; ``metres_per_unit`` says how
    many true metres a metre of now is, None without a length. Errors are in true metres, found
    less given: ``length_m`` (L,), ``height_m`` (H,), ``floor_m`` (F,) off the plane.
    """

    picks: Picks
    placed: tuple[PlacedPoint, ...]
    ground: Ground | None
    metres_per_unit: float | None
    length_m: np.ndarray
    height_m: np.ndarray
    floor_m: np.ndarray

    @property
    def scale_source(self) -> str:
        """Where the scale comes from, in words."""
        counts = [(len(self.length_m), "known length"), (len(self.height_m), "camera height")]
        parts = [f"{n} {what}{'s' if n > 1 else ''}" for n, what in counts if n]
        worst_m = float(np.abs(np.concatenate([self.length_m, self.height_m, [0.0]])).max())
        return f"{' and '.join(parts)} shown, right to {worst_m * 100:.1f} cm"

    def to_json(self) -> dict[str, Any]:
        """The residuals, JSON-ready: px of each pick, metres of lengths, heights and floor points."""
        floor_m = dict(zip([p.point.name for p in self.placed if p.point.floor], self.floor_m, strict=True))
        points = [
            {
                "name": one.point.name,
                "off_px": {
                    view.capture: None if np.isnan(off) else float(off)
                    for view, off in zip(one.point.views, one.off_px, strict=True)
                },
            }
            | ({"off_floor_m": float(floor_m[one.point.name])} if one.point.floor else {})
            for one in self.placed
        ]
        lengths = [
            {"from": one.start, "to": one.end, "metres": one.metres, "error_m": float(error)}
            for one, error in zip(self.picks.lengths, self.length_m, strict=True)
        ]
        heights = [
            {"capture": one.capture, "metres": one.metres, "error_m": float(error)}
            for one, error in zip(self.picks.heights, self.height_m, strict=True)
        ]
        return {"points": points, "lengths": lengths, "camera_heights": heights}

    def lines(self) -> list[str]:
        """The residuals for a person."""
        return residual_lines(self.to_json())

    def check(self) -> None:
        """Raise CaptureError for a pick or a length so far off that it must be a mistake."""
        for one in self.placed:
            for view, off_px, share in zip(one.point.views, one.off_px, one.off_share, strict=True):
                if share > _FARTHEST_PICKED:
                    raise CaptureError(
                        f"the photographs do not show one point '{one.point.name}': in {view.capture} it "
                        f"would lie {off_px:.0f} px away",
                        where=WHERE,
                        cure="Pick the same spot in each.",
                    )
        given = [(f"the length {one.start} to {one.end}", one.metres) for one in self.picks.lengths]
        given += [(f"the height of {one.capture}", one.metres) for one in self.picks.heights]
        errors = np.concatenate([self.length_m, self.height_m])
        for (what, metres), error_m in zip(given, errors, strict=True):
            if abs(error_m) > _WORST_LENGTH * metres:
                raise CaptureError(
                    f"{what} is given as {metres:.3f} m, the others say {metres + error_m:.3f} m",
                    where=WHERE,
                    cure="Measure it again, or take it or the others away.",
                )


def residual_lines(told: Mapping[str, Any]) -> list[str]:
    """The residuals of ``PicksFit.to_json`` for a person."""
    text = []
    for one in told.get("points", ()):
        seen = [f"{name} {'alone' if off is None else f'{off:.2f} px'}" for name, off in one["off_px"].items()]
        floor = f"; {in_centimetres(one['off_floor_m'])} off the floor" if "off_floor_m" in one else ""
        text.append(f"{one['name']}: {', '.join(seen)}{floor}")
    text += [
        f"{one['from']} to {one['to']}: {one['metres']:.3f} m, {in_centimetres(one['error_m'])}"
        for one in told.get("lengths", ())
    ]
    text += [
        f"camera {one['capture']}: {one['metres']:.3f} m high, {in_centimetres(one['error_m'])}"
        for one in told.get("camera_heights", ())
    ]
    return text


def in_centimetres(length_m: float) -> str:
    """A miss as a person reads it, such as ``+0.3 cm``."""
    return f"{round(length_m * 100.0, 1) + 0.0:+.1f} cm"  # and never -0.0


def fit_picks(picks: Picks, captures: Sequence[View], sparse: Sparse, progress: Progress = SILENT) -> PicksFit:
    """The least squares fit of ground and scale to picks, for captures in the world of now.

    The floor goes through the points marked as floor (``ground_through``); the scale makes
    lengths and camera heights right, each counting by how surely it is known. Without floor
    points, heights are above the floor of now. Raises CaptureError where a point cannot be
    placed, or the floor points make no floor.
    """
    picks.check()
    placed = tuple(placed_point(point, captures, sparse) for point in picks.points)
    on_floor = [one for one in placed if one.point.floor]
    ground = ground_through(captures, sparse, on_floor, progress) if on_floor else None
    found, sigma = _measured(picks, {one.point.name: one for one in placed}, captures, ground)
    given = np.array([*(one.metres for one in picks.lengths), *(one.metres for one in picks.heights)])
    factor = None
    if len(given):
        if not found.min() > 0.0:
            raise CaptureError(
                "the two ends of a length are one point, or a camera lies below the floor",
                where=WHERE,
                cure="Pick points far apart, and the floor where the photographs show it.",
            )
        factor = float((found * given / sigma**2).sum() / (found**2 / sigma**2).sum())
    after = found * (factor or 1.0) - given
    off = np.zeros(len(on_floor))
    if ground is not None:
        off = np.array([float(ground.height(one.position)) for one in on_floor]) * (factor or 1.0)
    count = len(picks.lengths)
    return PicksFit(picks, placed, ground, factor, after[:count], after[count:], off)


def placed_point(point: PickedPoint, captures: Sequence[View], sparse: Sparse) -> PlacedPoint:
    """Where a picked point lies: of all points the one seen nearest to its picks, in pixels.

    Picked in one capture alone it lies on the surface that the nearest sparse points span.
    Raises CaptureError for an unknown capture, a pixel outside, and views from one place.
    """
    views = [(_index(view, captures), np.array([view.x_px, view.y_px])) for view in point.views]
    if len(views) == 1:
        index, pixel = views[0]
        position = lifted(captures[index], sparse, index, pixel)
        distance = float(np.linalg.norm(position - captures[index].camera.centre))
        sure = (_LIFTED_SIGMA * distance) ** 2 * np.eye(3)
        return PlacedPoint(point, position, sure, np.full(1, np.nan), np.zeros(1))
    cameras, pixels = [captures[index].camera for index, _ in views], [xy for _, xy in views]
    position = intersection(cameras, pixels)
    for _ in range(_REFINEMENTS):
        jacobian, off = _reprojection(cameras, pixels, position)
        position = position - np.linalg.lstsq(jacobian, off, rcond=None)[0]
    jacobian, off = _reprojection(cameras, pixels, position)
    depths = np.array([camera.project(position)[1] for camera in cameras])
    off_px = np.where(depths > 0.0, np.linalg.norm(off.reshape(-1, 2), axis=1), np.inf)
    sides = np.array([max(camera.width, camera.height) for camera in cameras])
    sure = np.linalg.inv(jacobian.T @ jacobian) * _PICK_SIGMA_PX**2
    return PlacedPoint(point, position, sure, off_px, off_px / sides)


def _reprojection(
    cameras: Sequence[Camera], pixels: Sequence[np.ndarray], position: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The (2 n, 3) Jacobian of a point's pixels, and how far they lie off those picked (2 n,)."""
    rows, off = [], []
    for camera, pixel in zip(cameras, pixels, strict=True):
        rotation = camera.camera_from_world[:3, :3]
        x, y, z = rotation @ (position - camera.centre)
        z = z if abs(z) > 1e-9 else 1e-9
        rows.append(camera.fx / z * (rotation[0] - x / z * rotation[2]))
        rows.append(camera.fy / z * (rotation[1] - y / z * rotation[2]))
        off += [camera.fx * x / z + camera.cx - pixel[0], camera.fy * y / z + camera.cy - pixel[1]]
    return np.array(rows), np.array(off)


def _measured(
    picks: Picks, placed: Mapping[str, PlacedPoint], captures: Sequence[View], ground: Ground | None
) -> tuple[np.ndarray, np.ndarray]:
    """Each length and camera height in metres of now (L + H,), and how sure it is."""
    found, sigma = [], []
    for one in picks.lengths:
        start, end = placed[one.start], placed[one.end]
        along = end.position - start.position
        length = float(np.linalg.norm(along))
        along = along / max(length, 1e-12)
        variance = float(along @ (start.covariance + end.covariance) @ along)
        found.append(length)
        sigma.append(np.sqrt(variance + _TAPE_SIGMA_M**2))
    for held in picks.heights:
        centre = captures[_index(held, captures)].camera.centre
        found.append(float(centre[2] if ground is None else ground.height(centre)))
        sigma.append(_HEIGHT_SIGMA_M)
    return np.array(found, np.float64), np.array(sigma, np.float64)


def _index(named: Pick | CameraHeight, captures: Sequence[View]) -> int:
    """The capture that a pick or a height names. Raises CaptureError, also for a pixel outside it."""
    index = next((i for i, capture in enumerate(captures) if capture.name == named.capture), None)
    if index is None:
        raise CaptureError(
            f"there is no capture '{named.capture}'",
            where=WHERE,
            cure=f"Name one of {', '.join(capture.name for capture in captures)}.",
        )
    camera = captures[index].camera
    if isinstance(named, Pick) and not (0.0 <= named.x_px <= camera.width and 0.0 <= named.y_px <= camera.height):
        raise CaptureError(
            f"pixel ({named.x_px:.0f}, {named.y_px:.0f}) lies outside the {camera.width}x{camera.height} image",
            where=f"{WHERE}, {named.capture}",
            cure="Give pixels of the image in captures/images.",
        )
    return index
