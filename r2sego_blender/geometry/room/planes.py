"""The planes of a room: dominant planes of the observed points and the envelope they form.

Rooms are mostly planes, and where the captures saw too little to triangulate, a plane seen
elsewhere is the likeliest surface. The *envelope* are the planes that bound the room: all
captures and almost all points lie on their free side. Only surfaces that were seen become
planes, so an unseen wall or ceiling is never invented: the room stays open there. Bounds
that were seen, but not by enough captures for stereo, are added by ``bounds``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from ...bundle import layout
from ...bundle.artifacts import Artifact
from ...config.settings import ProxySettings
from ...core.arrays import opened_arrays, require_between, require_shapes, save_arrays
from ...core.cameras import Camera
from ...core.errors import GeometryError
from ..stereo.observed_geometry import FARTHEST_M, LONGEST_UNIT, ObservedGeometry

_HYPOTHESES = 256  # points whose own tangent plane is tried for each plane
_SCORED_POINTS = 8_000  # points a hypothesis is scored on; all take part in the refinement
_NORMAL_AGREEMENT = 0.9  # cosine between a point's normal and the plane's
_UPRIGHT = np.cos(np.radians(3.0))  # planes this near to level or upright are made exactly so
_ABOUT_UPRIGHT = np.cos(np.radians(12.0))  # of what was estimated
_PARALLEL = np.cos(np.radians(8.0))
_SAME_WALL_M = 0.15  # parallel bounds nearer than this are one wall and what hangs on it


@dataclass(frozen=True)
class RoomPlanes:
    """Planes n.x = d in the world frame, the floor z = 0 first.

    ``normals`` (P, 3) float64, unit, towards the free side; ``offsets`` (P,) float64 in
    metres; ``inliers`` (P,) int64 observed points on the plane; ``bounding`` (P,) bool,
    the planes of the room's envelope.
    """

    normals: np.ndarray
    offsets: np.ndarray
    inliers: np.ndarray
    bounding: np.ndarray

    @property
    def envelope(self) -> RoomPlanes:
        """The bounding planes alone."""
        return RoomPlanes(*(getattr(self, n)[self.bounding] for n in self.__dataclass_fields__))

    def with_more(self, normals: np.ndarray, offsets: np.ndarray, inliers: np.ndarray, bounding: bool) -> RoomPlanes:
        """These, and then planes (M, 3), (M,) with (M,) inliers that are all ``bounding``, or not."""
        return RoomPlanes(
            np.concatenate([self.normals, normals]),
            np.concatenate([self.offsets, offsets]),
            np.concatenate([self.inliers, inliers]),
            np.concatenate([self.bounding, np.full(len(offsets), bounding)]),
        )

    def depths(self, camera: Camera) -> np.ndarray:
        """(P, H, W) float32 planar depth at which each pixel's ray meets each plane's free
        side, 0 where it does not."""
        inverse = self.inverse_depth_rows(camera)
        rays = camera.rays().reshape(-1, 3)
        values = (inverse @ rays.T).astype(np.float32).reshape(-1, *camera.shape)
        seen = values > 1e-6
        return np.divide(np.float32(1.0), values, out=np.zeros_like(values), where=seen)

    def inverse_depth_rows(self, camera: Camera) -> np.ndarray:
        """(P, 3) float64 q with 1 / depth = q.ray for a pixel's camera ray (z = 1).

        A plane behind whose free side the camera stands has q = 0: it is not seen.
        """
        height = self.normals @ camera.centre - self.offsets
        local = self.normals @ camera.world_from_camera[:3, :3]
        seen = height > 1e-6
        return np.where(seen[:, None], -local / np.where(seen, height, 1.0)[:, None], 0.0)

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        """(...,) the distance of points (..., 3) to the nearest plane's half-space border,
        positive inside the intersection of the free sides; inf without planes."""
        if not len(self.normals):
            return np.full(points.shape[:-1], np.inf)
        return (points @ self.normals.T - self.offsets).min(-1)

    def save(self, path: Path) -> None:
        """Write the arrays as an uncompressed ``.npz``."""
        save_arrays(path, **{field.name: getattr(self, field.name) for field in fields(self)})

    @staticmethod
    def load(path: Path) -> RoomPlanes:
        """Read what ``save`` wrote. Raises GeometryError when the file holds no planes."""
        with opened_arrays(path, GeometryError, "these are not room planes") as data:
            arrays = {field.name: data[field.name] for field in fields(RoomPlanes)}
            require_shapes(arrays, normals="P 3", offsets="P", inliers="P", bounding="P")
            require_between(-FARTHEST_M, FARTHEST_M, offsets=arrays["offsets"])
            require_between(-LONGEST_UNIT, LONGEST_UNIT, normals=arrays["normals"])
            require_between(0, None, inliers=arrays["inliers"])
            lengths = np.linalg.norm(arrays["normals"], axis=1)
            require_between(2.0 - LONGEST_UNIT, LONGEST_UNIT, normals=lengths)
            if arrays["bounding"].dtype != np.bool_:
                raise ValueError("bounding is not yes or no")
            return RoomPlanes(**arrays)


def find_planes(
    observed: ObservedGeometry,
    cameras: Sequence[Camera],
    settings: ProxySettings,
    rng: np.random.Generator,
    spread_m: float = 0.0,
) -> RoomPlanes:
    """The floor z = 0 and up to ``settings.planes`` more planes, by sequential RANSAC.

    Each hypothesis is one point and its normal; the best is refined by total least squares
    on its inliers and, when nearly level or upright, made exactly so (gravity is known from
    the world frame). ``cameras`` are the captures': a bounding plane has them all on its
    free side. ``spread_m``: how far most points are off, where that is more than usual.
    """
    settings = replace(settings, plane_tolerance_m=max(settings.plane_tolerance_m, spread_m))
    points = np.asarray(observed.points, np.float64)
    normals = np.asarray(observed.normals, np.float64)
    tolerance = settings.plane_tolerance_m
    needed = max(8, round(settings.plane_share * len(points)))
    floor = (np.abs(points[:, 2]) < 2 * tolerance) & (normals[:, 2] > _NORMAL_AGREEMENT)
    found = [(np.array([0.0, 0.0, 1.0]), 0.0, int(floor.sum()))]
    left = np.flatnonzero(~floor)
    while len(found) <= settings.planes and len(left) >= needed:
        normal, offset = _best_hypothesis(points[left], normals[left], tolerance, rng)
        for _ in range(3):
            on = _on_plane(points[left], normals[left], normal, offset, tolerance)
            if on.sum() < 3:
                break
            normal, offset = _fitted(points[left[on]], normal, _UPRIGHT if spread_m == 0.0 else _ABOUT_UPRIGHT)
        on = _on_plane(points[left], normals[left], normal, offset, tolerance)
        if on.sum() < needed:
            break
        found.append((normal, offset, int(on.sum())))
        left = left[~on]
    planes = RoomPlanes(
        np.array([n for n, _, _ in found]),
        np.array([d for _, d, _ in found]),
        np.array([count for _, _, count in found]),
        np.zeros(len(found), bool),
    )
    centres = np.array([camera.centre for camera in cameras]).reshape(-1, 3)
    planes.bounding[:] = _bounding(planes, points, centres, settings)
    if spread_m > 0.0:  # an estimate leans and bends: what bounds a room does not
        planes.bounding[:] &= np.isin(np.abs(planes.normals[:, 2]), (0.0, 1.0))
    return planes


def _best_hypothesis(
    points: np.ndarray, normals: np.ndarray, tolerance: float, rng: np.random.Generator
) -> tuple[np.ndarray, float]:
    scored = rng.integers(0, len(points), _SCORED_POINTS)
    tried = rng.integers(0, len(points), _HYPOTHESES)
    candidates = normals[tried].astype(np.float32)
    offsets = np.einsum("ij,ij->i", normals[tried], points[tried])
    distances = points[scored].astype(np.float32) @ candidates.T
    distances -= offsets.astype(np.float32)
    on = np.abs(distances, out=distances) < tolerance
    on &= normals[scored].astype(np.float32) @ candidates.T > _NORMAL_AGREEMENT
    best = int(np.argmax(on.sum(0)))
    return normals[tried[best]], float(offsets[best])


def _on_plane(
    points: np.ndarray, normals: np.ndarray, normal: np.ndarray, offset: float, tolerance: float
) -> np.ndarray:
    return (np.abs(points @ normal - offset) < tolerance) & (normals @ normal > _NORMAL_AGREEMENT)


def _fitted(points: np.ndarray, towards: np.ndarray, upright: float) -> tuple[np.ndarray, float]:
    """The least-squares plane of the points, its normal on the side of ``towards``; made level or upright where it
    is, within the angle of the cosine ``upright``."""
    centre = points.mean(0)
    normal = np.linalg.eigh(np.cov((points - centre).T))[1][:, 0]
    normal *= np.sign(normal @ towards) or 1.0
    if abs(normal[2]) > upright:
        normal = np.array([0.0, 0.0, np.sign(normal[2])])
    elif np.hypot(normal[0], normal[1]) > upright:
        normal = np.array([normal[0], normal[1], 0.0]) / np.hypot(normal[0], normal[1])
    return normal, float(normal @ centre)


def _bounding(planes: RoomPlanes, points: np.ndarray, centres: np.ndarray, settings: ProxySettings) -> np.ndarray:
    """(P,) bool: all cameras and almost all points on the free side; of parallel planes close
    together (a wall, its skirting, its pictures) only the outermost that is well supported."""
    slack = 3 * settings.plane_tolerance_m
    heights = points @ planes.normals.T - planes.offsets
    share = (heights > -slack).mean(0) if len(points) else np.ones(len(planes.offsets))
    inside = (centres @ planes.normals.T - planes.offsets > 0).all(0)
    bounding = inside & (share >= settings.envelope_share)
    bounding &= planes.normals[:, 2] < _UPRIGHT  # a table over whose floor nothing was measured is no floor
    bounding[0] = True  # the floor is known from the world frame
    reach = planes.normals @ np.median(np.concatenate([points, centres]), axis=0) - planes.offsets
    for i in np.flatnonzero(bounding):
        if not bounding[i]:  # a twin of one before
            continue
        twins = bounding & (planes.normals @ planes.normals[i] > _PARALLEL)
        twins &= np.abs(reach - reach[i]) < _SAME_WALL_M
        weighty = twins & (planes.inliers >= 0.2 * planes.inliers[twins].max())
        outermost = np.flatnonzero(weighty)[np.argmax(reach[weighty])]
        keep = 0 if twins[0] else outermost
        bounding[twins] = False
        bounding[keep] = True
    return bounding


PLANES = Artifact(layout.PLANES, RoomPlanes.load, RoomPlanes.save)
"""The room's planes: the embedded shape prior."""
