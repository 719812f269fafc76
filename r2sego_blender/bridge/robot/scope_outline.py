"""The outline of a mesh or curve on the floor, as the polygon of a behaviour region."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ...core.errors import SceneError
from ...robot.scope.region import Polygon, area_m2, problem_of
from ..shared.simplified_viewport import every_face


def outline_of(shown: bpy.types.Object | None, depsgraph: bpy.types.Depsgraph) -> Polygon:
    """The polygon around a mesh or curve, seen from above, metres in the world.

    That of its open border or its closed line, the one with the largest area; for a body
    without a border, its convex hull. Raises SceneError when it bounds nothing.
    """
    if shown is None or shown.type not in {"MESH", "CURVE"}:
        raise SceneError(
            "the active object is no mesh and no curve",
            where=getattr(shown, "name", "no object"),
            cure="Select one that lies on the floor.",
        )
    with every_face(shown, depsgraph) as evaluated:
        mesh = evaluated.to_mesh()
        try:
            points, edges, uses = _arrays(mesh, np.array(shown.matrix_world, np.float64))
        finally:
            evaluated.to_mesh_clear()
    loops = [points[loop] for loop in closed_loops(edges[uses < 2])]
    corners = max(loops, key=lambda loop: abs(area_m2(loop.tolist())), default=None)
    if corners is None or problem_of(corners.tolist()):
        corners = convex_hull(points)
    corners = corners.tolist()
    if problem := problem_of(corners):
        raise SceneError(f"the outline {problem}", where=shown.name, cure="Choose another object, or draw the region.")
    return tuple((x, y) for x, y in corners)


def closed_loops(edges: np.ndarray) -> list[list[int]]:
    """The simple closed lines among edges (E, 2): pieces whose points have two edges each, in order."""
    neighbours: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    loops, waiting = [], set(neighbours)
    while waiting:
        start = min(waiting)
        loop, here, before = [start], start, -1
        waiting.discard(start)
        while True:
            onward = [point for point in neighbours[here] if point != before]
            if len(neighbours[here]) != 2 or not onward:
                loop = []
                break
            before, here = here, onward[0]
            if here == start:
                break
            if here not in waiting:
                loop = []
                break
            waiting.discard(here)
            loop.append(here)
        if len(loop) >= 3:
            loops.append(loop)
    return loops


def convex_hull(points: Sequence[Sequence[float]]) -> np.ndarray:
    """(n, 2) the corners of the convex hull of (P, 2), counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted({(float(x), float(y)) for x, y in points})

    def chain(along: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        kept: list[tuple[float, float]] = []
        for point in along:
            while len(kept) >= 2 and _turn(kept[-2], kept[-1], point) <= 0.0:
                kept.pop()
            kept.append(point)
        return kept[:-1]

    return np.array(chain(ordered) + chain(ordered[::-1])).reshape(-1, 2)


def _turn(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _arrays(mesh: bpy.types.Mesh, world_from_own: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (P, 2) from above in the world, edges (E, 2), and how many faces use each edge (E,)."""
    places = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", places)
    places = places.reshape(-1, 3) @ world_from_own[:3, :3].T + world_from_own[:3, 3]
    edges = np.empty(2 * len(mesh.edges), np.int32)
    mesh.edges.foreach_get("vertices", edges)
    used = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("edge_index", used)
    return places[:, :2], edges.reshape(-1, 2), np.bincount(used, minlength=len(mesh.edges))
