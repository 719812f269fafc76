"""The envelope of the room as polygons and as a tessellated surface."""

from __future__ import annotations

import numpy as np

from .planes import RoomPlanes


def envelope_polygons(envelope: RoomPlanes, low: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
    """Each plane's part that bounds the room, inside the box ``low``..``high`` (3,).

    Polygons are (K, 3) float64, counter-clockwise from the free side, and empty for a plane
    that other planes cut off entirely. The box only ends planes that no other plane ends:
    its own sides are never a surface, so a room whose wall was not seen stays open there.
    """
    box = np.concatenate([np.eye(3), -np.eye(3)])
    normals = np.concatenate([envelope.normals, box])
    offsets = np.concatenate([envelope.offsets, low, -np.asarray(high, np.float64)])
    reach = 4.0 * float(np.linalg.norm(high - low))
    centre = (np.asarray(low) + high) / 2.0
    polygons = []
    for i, (normal, offset) in enumerate(zip(envelope.normals, envelope.offsets, strict=True)):
        right, up = plane_axes(normal)
        foot = centre - (centre @ normal - offset) * normal
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * reach
        polygon = foot + corners @ np.stack([right, up])
        for j in range(len(normals)):
            if j != i:
                polygon = _clipped(polygon, normals[j], offsets[j])
        polygons.append(polygon)
    return polygons


def tessellated(polygon: np.ndarray, normal: np.ndarray, cell_m: float) -> np.ndarray:
    """The cells of about ``cell_m`` a side that cover a polygon: (C, 4, 3) float64 corners,
    counter-clockwise seen against ``normal``. Rectangles along the plane's axes are covered
    exactly, other borders to half a cell."""
    if len(polygon) < 3:
        return np.zeros((0, 4, 3))
    axes = np.stack(plane_axes(normal))
    flat = polygon @ axes.T
    low, extent = flat.min(0), np.ptp(flat, axis=0)
    counts = np.maximum(1, np.ceil(extent / cell_m - 1e-9)).astype(int)
    i, j = (index.ravel() for index in np.meshgrid(np.arange(counts[0]), np.arange(counts[1]), indexing="ij"))
    step = extent / counts
    centres = low + (np.stack([i, j], 1) + 0.5) * step
    following = np.roll(flat, -1, axis=0)
    edges = following - flat
    inside = np.ones(len(centres), bool)
    for start, edge in zip(flat, edges, strict=True):
        away = centres - start
        inside &= edge[0] * away[:, 1] - edge[1] * away[:, 0] >= -1e-12
    offsets = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) * step
    corners = centres[inside, None] + offsets
    height = float(polygon[0] @ normal)
    return corners @ axes + height * normal


def plane_axes(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit axes in the plane, right-handed with ``normal``; ``right`` is level."""
    reference = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    right = np.cross(reference, normal)
    right /= np.linalg.norm(right)
    return right, np.cross(normal, right)


def _clipped(polygon: np.ndarray, normal: np.ndarray, offset: float) -> np.ndarray:
    """The part of a convex polygon on the free side of a plane (Sutherland and Hodgman)."""
    heights = polygon @ normal - offset
    kept = []
    for index in range(len(polygon)):
        following = (index + 1) % len(polygon)
        a, b = heights[index], heights[following]
        if a >= 0:
            kept.append(polygon[index])
        if (a >= 0) != (b >= 0):
            kept.append(polygon[index] + a / (a - b) * (polygon[following] - polygon[index]))
    return np.array(kept).reshape(-1, 3)
