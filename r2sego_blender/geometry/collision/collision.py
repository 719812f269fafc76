"""The collision surface: what a simulated robot touches, made of the geometry proxy.

A mesh collides as its convex hull in MuJoCo, so the surface is exported as convex pieces
(see ``convex``); the floor is one box with its top at z = 0, since feet need a flat one.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...config.settings import CollisionSettings
from ...core.errors import GeometryError
from ...core.formatting import told_apart
from ...core.progress import SILENT, Progress
from ..mesh.meshes import compacted, connected, merged, places
from ..proxy.proxy import GeometryProxy, Provenance
from .coacd_regions import decompose_by_coacd
from .convex import Limits, Soup, decompose

_FLOOR_NORMAL = 0.8  # cosine from which a face near z = 0 belongs to the floor
_SMALLEST_FLOOR_M2 = 0.05


@dataclass(frozen=True)
class CollisionSurface:
    """The surface a robot collides with, in the world frame, metres.

    ``vertices`` (V, 3) float64 and ``faces`` (F, 3) int32: the simplified surface,
    counter-clockwise from the free side, the floor included; ``pieces``: convex (vertices
    (v, 3), faces (f, 3)) pairs covering all of it but the floor; ``floor`` (4, 3): the
    corners of the flat floor's rectangle at z = 0, counter-clockwise from above, (0, 3) for
    none; ``tolerance_m``: how far pieces may stand out of the surface, inf where nothing
    bounds it.

    Each piece is closed (watertight). The surface itself is as open as the proxy: it ends where
    nothing was seen or completed.
    """

    vertices: np.ndarray
    faces: np.ndarray
    pieces: tuple[tuple[np.ndarray, np.ndarray], ...]
    floor: np.ndarray
    tolerance_m: float


def collision_surface(
    proxy: GeometryProxy, settings: CollisionSettings, progress: Progress = SILENT
) -> CollisionSurface:
    """Clean and simplify the proxy, and decompose it into convex pieces.

    Cut into planes, they are at most ``max_pieces``: the tolerance grows until they are few
    enough. With CoACD, their number and how far they stand out are its own. Raises
    GeometryError for a proxy without faces.
    """
    vertices = _completed_on_the_floor(proxy, settings.completed_floor_m)
    vertices, faces = _clustered(vertices, proxy.faces, settings.simplification_m)
    vertices[:, 2] = np.maximum(vertices[:, 2], 0.0)
    vertices, faces = _without_crumbs(vertices, faces, settings.min_component_m)
    if not len(faces):
        raise GeometryError(
            "the proxy has no surface to collide with",
            where="collision surface",
            cure="Take more photographs, or lower collision.min_component_m.",
        )
    vertices, faces, on_floor = _floor_laid_flat(vertices, faces, settings.floor_tolerance_m)
    floor = _floor_rectangle(vertices, faces[on_floor])
    limits = Limits(
        settings.cell_m, settings.min_cell_m, settings.tolerance_m, settings.carrying_tolerance_m, settings.thickness_m
    )
    floored = len(floor) > 0
    if settings.decomposition == "coacd":
        pieces = decompose_by_coacd(
            vertices,
            faces[~on_floor],
            settings.coacd_region_m,
            limits,
            settings.max_pieces,
            timeout_s=settings.coacd_timeout_s,
            floored=floored,
            progress=progress,
        )
        return CollisionSurface(vertices, faces, tuple(pieces), floor, np.inf)
    soup = Soup.of(vertices, faces[~on_floor])
    pieces, limits = decompose(soup, limits, settings.max_pieces, floored, progress)
    if limits.tolerance_m > settings.tolerance_m:
        found_cm, set_cm = 100.0 * limits.tolerance_m, 100.0 * settings.tolerance_m
        progress.message(
            f"collision pieces stand out by up to {told_apart(found_cm, set_cm, 1)} cm, not the "
            f"{set_cm:.6g} cm that are set: with less they would be more than "
            f"{settings.max_pieces} (collision.max_pieces)",
            level="warning",
        )
    return CollisionSurface(vertices, faces, tuple(pieces), floor, limits.tolerance_m)


def _completed_on_the_floor(proxy: GeometryProxy, height_m: float) -> np.ndarray:
    """The proxy's vertices (V, 3), on the floor those below ``height_m`` with none but completed and
    estimated faces.

    Depth that was filled in or estimated is off by centimetres: a low bump of it would only stop feet. What
    stands on the floor stays standing on it, since its lowest vertices move too.
    """
    vertices = np.array(proxy.vertices, np.float64)
    _, place = np.unique(places(vertices), axis=0, return_inverse=True)
    place = place.ravel()
    known = np.zeros(len(vertices), bool)
    guessed = np.isin(proxy.provenance, [Provenance.COMPLETED, Provenance.ESTIMATED])
    known[place[proxy.faces[~guessed]]] = True
    vertices[(vertices[:, 2] < height_m) & ~known[place], 2] = 0.0
    return vertices


def _clustered(vertices: np.ndarray, faces: np.ndarray, cell_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices in one grid cell become their mean; faces that collapse go, doubles too."""
    vertices = np.asarray(vertices, np.float64)
    means, cluster = merged(vertices, np.floor(vertices / cell_m + 0.5).astype(np.int64))
    return means, _proper_faces(cluster[faces])


def _proper_faces(faces: np.ndarray) -> np.ndarray:
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    first = faces.argmin(1)
    turned = np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1)
    return np.unique(turned, axis=0).astype(np.int32)


def _without_crumbs(vertices: np.ndarray, faces: np.ndarray, smallest_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Without connected components whose bounding box is smaller than this across."""
    if not len(faces):
        return vertices, faces
    component = connected(faces, len(vertices))
    count = component.max() + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, component, vertices)
    np.maximum.at(high, component, vertices)
    large = np.linalg.norm(high - low, axis=1) >= smallest_m
    return compacted(vertices, faces[large[component[faces[:, 0]]]])


def _floor_laid_flat(
    vertices: np.ndarray, faces: np.ndarray, tolerance_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The vertices, the floor's in z = 0; the faces; and (F,) bool, which lie in z = 0.

    Level faces near z = 0 are the floor. What hangs on them may come to lie in z = 0 with them, and
    not all of that faces up: a face that looks into the floor would be a slab on it, and goes.
    """
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = cross[:, 2] > _FLOOR_NORMAL * np.linalg.norm(cross, axis=1)
    vertices = vertices.copy()
    vertices[np.unique(faces[level & (corners[:, :, 2].max(1) < tolerance_m)]), 2] = 0.0
    on_floor = vertices[faces][:, :, 2].max(1) <= 1e-9
    kept = ~on_floor | (cross[:, 2] > 0.0)  # seen from above, what is laid flat turns as before
    return vertices, faces[kept], on_floor[kept]


def _floor_rectangle(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(4, 3) corners of the smallest rectangle around the floor, in z = 0."""
    points = vertices[np.unique(faces)][:, :2] if len(faces) else np.zeros((0, 2))
    if len(points) < 3:
        return np.zeros((0, 3))
    (x, y), (width, depth), angle = cv2.minAreaRect(points.astype(np.float32))
    if width * depth < _SMALLEST_FLOOR_M2:
        return np.zeros((0, 3))
    turn = np.radians(angle)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (width / 2, depth / 2)
    return np.column_stack([corners @ axes + (x, y), np.zeros(4)])
