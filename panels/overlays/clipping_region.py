"""A 3D view's Clipping Region (Alt-B), kept to by what is drawn over the view."""

import bpy
import gpu
import numpy as np

from ...r2sego_blender.splats.regions import on_kept_sides

_PLANES = 4
"""So many of the planes that Blender has for a region bound it; the others are zero."""


def kept_sides(view: bpy.types.RegionView3D) -> np.ndarray | None:
    """(4, 4) planes in the world, a row each: what is shown lies on the positive side of all of them.

    None for a view without a region.
    """
    return np.array(view.clip_planes[:_PLANES]) if view.use_clip_planes else None


def kept(points: np.ndarray, sides: np.ndarray | None) -> np.ndarray:
    """(M,) which of the ``points`` (N, 3) lie on the kept sides, as indices in their order."""
    if sides is None:
        return np.arange(len(points))
    return np.flatnonzero(on_kept_sides(points, sides.astype(np.float32)))


class ClippedPoints:
    """Points on the graphics card, of which a view draws those in its Clipping Region.

    ``vertices`` hold them, ``places`` (N, 3) tell where they are.
    """

    def __init__(self, vertices: gpu.types.GPUVertBuf, places: np.ndarray) -> None:
        self._vertices, self._places = vertices, places
        self._whole = gpu.types.GPUBatch(type="POINTS", buf=vertices)
        self._sides: np.ndarray | None = None
        self._kept, self._kept_count = self._whole, len(places)

    def draw(self, shader: gpu.types.GPUShader, count: int, sides: np.ndarray | None) -> None:
        """Draw the first ``count`` of the points that are kept by ``sides`` (4, 4), or of all."""
        if sides is None:
            self._whole.draw_range(shader, elem_start=0, elem_count=count)
            return
        if not np.array_equal(sides, self._sides):
            chosen = kept(self._places, sides).astype(np.uint32)
            self._sides, self._kept_count = sides, len(chosen)
            if len(chosen):
                indices = gpu.types.GPUIndexBuf(type="POINTS", seq=chosen)
                self._kept = gpu.types.GPUBatch(type="POINTS", buf=self._vertices, elem=indices)
        if self._kept_count:
            self._kept.draw_range(shader, elem_start=0, elem_count=min(count, self._kept_count))
