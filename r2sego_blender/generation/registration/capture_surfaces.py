"""A capture as the surface it shows: its photograph on its own depth, seen from elsewhere.

Features of a photograph are hardly found again in a view from a robot's height: floors and
shelves are foreshortened, near things are large. Moved to the other camera by its own depth
first, the photograph differs from the view by a few pixels only.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...captures.capture import Capture
from ...core.cameras import Camera
from ...geometry.mesh.meshes import compacted
from ...geometry.visibility.rasterizer import MeshRasterizer

# Neighbours of the grid that differ by more than this, relative, are two surfaces.
_EDGE_JUMP = 0.05
_GRID_SIDE = 320  # vertices along the longer side: finer than stereo resolves
# Relative errors (standard deviation) of reliable stereo depth and of depth that was completed.
_OBSERVED_ERROR = 0.01
_COMPLETED_ERROR = 0.05
# A pixel of the photograph that would cover more pixels than this a side is a smear.
_LARGEST_STRETCH = 8.0


@dataclass(frozen=True)
class MovedCapture:
    """A capture's photograph moved to another camera.

    ``grey`` (H, W) float32 in [0, 1]; ``depth`` (H, W) float32 the other camera's planar
    depth in metres, 0 where the capture shows nothing or only a smear; ``pixels``
    (H, W, 2) float32 where the colour stands in the photograph.
    """

    grey: np.ndarray
    depth: np.ndarray
    pixels: np.ndarray


class CaptureSurface:
    """One capture's photograph on the surface of its depth, cut open at depth edges."""

    def __init__(self, capture: Capture, observed: np.ndarray, completed: np.ndarray | None = None) -> None:
        """``observed`` (H, W): reliable planar depth, metres, 0 = unknown; ``completed``,
        when given, is taken where that is unknown, as less certain."""
        self.camera = capture.camera
        self._grey = cv2.cvtColor(capture.image(), cv2.COLOR_RGB2GRAY)
        known = observed > 0.0
        depth = observed if completed is None else np.where(known, observed, completed)
        self._error = np.where(known, _OBSERVED_ERROR, _COMPLETED_ERROR).astype(np.float32)
        vertices, faces = _grid(capture.camera, depth)
        self.face_count = len(faces)
        self._rasterizer = MeshRasterizer(vertices, faces)

    def seen_from(self, camera: Camera) -> MovedCapture:
        """The photograph moved to ``camera``."""
        depth = self._rasterizer.render(camera).depth
        pixels = self._pixels(camera, depth)
        across = cv2.Sobel(pixels, -1, 1, 0, ksize=1) / 2.0
        down = cv2.Sobel(pixels, -1, 0, 1, ksize=1) / 2.0
        # the area of a pixel on the photograph; negative where the surface is seen from behind
        area = across[..., 0] * down[..., 1] - across[..., 1] * down[..., 0]
        depth = np.where(area * _LARGEST_STRETCH**2 > 1.0, depth, np.float32(0.0))
        place = pixels - np.float32(0.5)
        grey = cv2.remap(  # type: ignore[call-overload]  # whose types know no single map
            self._grey, place, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return MovedCapture(grey, depth, pixels)

    def _pixels(self, camera: Camera, depth: np.ndarray) -> np.ndarray:
        """(H, W, 2) float32: where the capture has what ``camera`` sees at planar ``depth``."""
        capture_from_camera = (self.camera.camera_from_world @ camera.world_from_camera).astype(np.float32)
        local = camera.rays().astype(np.float32) * depth[..., None]
        local = local @ capture_from_camera[:3, :3].T + capture_from_camera[:3, 3]
        z = np.maximum(local[..., 2:], np.float32(1e-6))
        focal = np.array([self.camera.fx, self.camera.fy], np.float32)
        centre = np.array([self.camera.cx, self.camera.cy], np.float32)
        # OpenCV's maps are clipped to what its fixed-point arithmetic can hold
        return np.clip(local[..., :2] / z * focal + centre, np.float32(-1e4), np.float32(3e4))

    def lift(
        self, moved: MovedCapture, camera: Camera, columns: np.ndarray, rows: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """World points (n, 3) float64 of pixels of ``moved``, and their spreads.

        A spread (n, 3) is how far, in metres, one standard deviation of the capture's own
        depth carries the point along the capture's ray.
        """
        z = moved.depth[rows, columns].astype(np.float64)
        x = (columns + 0.5 - camera.cx) / camera.fx * z
        y = (rows + 0.5 - camera.cy) / camera.fy * z
        pose = camera.world_from_camera
        points = np.stack([x, y, z], axis=1) @ pose[:3, :3].T + pose[:3, 3]
        height, width = self._error.shape
        places = np.floor(moved.pixels[rows, columns]).astype(np.int64)
        u, v = np.clip(places[:, 0], 0, width - 1), np.clip(places[:, 1], 0, height - 1)
        return points, (points - self.camera.centre) * self._error[v, u, None]


def _grid(camera: Camera, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and faces (F, 3) of a depth map, none across depth edges."""
    height, width = depth.shape
    step = max(1, round(max(width, height) / _GRID_SIDE))
    rows, columns = np.arange(step // 2, height, step), np.arange(step // 2, width, step)
    z = depth[np.ix_(rows, columns)].astype(np.float64)
    number = np.arange(z.size).reshape(z.shape)
    corners = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1)
    of_corners = z.ravel()[corners]
    nearest, farthest = of_corners.min(axis=-1), of_corners.max(axis=-1)
    quads = corners[(nearest > 0.0) & (farthest - nearest < _EDGE_JUMP * farthest)]
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    used, faces = compacted(number.ravel(), faces)
    row, column, z = rows[used // z.shape[1]], columns[used % z.shape[1]], z.ravel()[used]
    x = (column + 0.5 - camera.cx) / camera.fx * z
    y = (row + 0.5 - camera.cy) / camera.fy * z
    points = np.stack([x, y, z], axis=1) @ camera.world_from_camera[:3, :3].T + camera.centre
    return points, faces
