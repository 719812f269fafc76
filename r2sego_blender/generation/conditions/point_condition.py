"""The colour point condition: the captures' colours on the geometry proxy, along a camera path.

ViewCrafter (Yu et al. 2024) is conditioned on a coloured point cloud rendered along the path:
black where there is no point, its first frame the reference image itself. Here every pixel
of a structural condition is a point, and its colour that of one capture which sees it. That
capture is chosen by the point alone, never by the frame: like a cloud's, the points do not
change their colours as the camera moves. The same look at the captures counts how many of
them see each point, the visibility pass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...captures.capture import Capture
from ...config.settings import GenerationSettings
from ...core.cameras import Camera
from ...core.compiled import parallel_kernel, prange
from ...core.errors import GenerationError
from ...core.images import resize
from ...geometry.visibility.point_visibility import PROXY_ROUGHNESS_M
from ...geometry.visibility.projection import NEAR_M
from .conditions import Condition

_NEAR_M = np.float32(NEAR_M)
_SAME_POSE = 1e-9
_MOST_CAPTURES = 255


@dataclass(frozen=True)
class PointCondition:
    """The captures' colours as one camera of a path sees them.

    ``colour`` (H, W, 3) float32 in [0, 1], black where nothing is known; ``known`` (H, W)
    bool; ``visibility`` (H, W) uint8, the number of captures that see the surface point.
    """

    colour: np.ndarray
    known: np.ndarray
    visibility: np.ndarray


class PointConditions:
    """Renders the colour point condition, and the visibility, of conditions of one proxy."""

    def __init__(
        self, captures: Sequence[Capture], capture_depths: Sequence[np.ndarray], settings: GenerationSettings
    ) -> None:
        """``capture_depths``: the proxy's depth in each capture, (H, W) of its camera, metres.

        Raises GenerationError without captures, ValueError for depths of another size.
        """
        if not captures:
            raise GenerationError("there are no captures to colour with", cure="Import the photographs again.")
        cameras = [capture.camera for capture in captures]
        if [np.shape(depth) for depth in capture_depths] != [camera.shape for camera in cameras]:
            raise ValueError("each capture needs one depth map of its camera's size")
        areas = [camera.width * camera.height for camera in cameras]
        self._cameras = cameras
        self._images = [capture.image() for capture in captures]
        self._tolerance = np.float32(settings.depth_tolerance)
        self._captures = (
            np.stack([camera.camera_from_world[:3] for camera in cameras]).astype(np.float32),
            np.array([[c.fx, c.fy, c.cx, c.cy] for c in cameras], np.float32),
            np.array([[c.width, c.height] for c in cameras], np.int64),
            np.concatenate([[0], np.cumsum(areas)[:-1]]).astype(np.int64),
            np.concatenate([np.ravel(depth) for depth in capture_depths]).astype(np.float32),
            np.concatenate([image.reshape(-1, 3) for image in self._images]),
        )

    def render(self, reference: int, conditions: Sequence[Condition]) -> list[PointCondition]:
        """One point condition a condition, at its size.

        A point takes its colour from the capture ``reference``, i(v), if that sees it, else
        from the capture that shows it largest. A frame at the reference's own pose is the
        reference image, seen through the frame's lens: where the lens is wider, the points
        go on beyond the image.
        """
        return [self._at(reference, condition) for condition in conditions]

    def visibility(self, condition: Condition) -> np.ndarray:
        """(H, W) uint8: how many captures see the surface at each pixel, 255 at most."""
        return self._at(0, condition).visibility

    def _at(self, reference: int, condition: Condition) -> PointCondition:
        camera = condition.camera
        colour, count = _coloured(
            condition.depth,
            condition.normal,
            camera.world_from_camera.astype(np.float32),
            np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32),
            reference,
            self._tolerance,
            *self._captures,
        )
        known = count > 0
        own = self._cameras[reference]
        if np.allclose(camera.world_from_camera, own.world_from_camera, rtol=0.0, atol=_SAME_POSE):
            image, inside = _through_lens(self._images[reference], own, camera)
            colour[inside], known = image[inside], known | inside
        return PointCondition(colour, known, count)


def _through_lens(image: np.ndarray, own: Camera, lens: Camera) -> tuple[np.ndarray, np.ndarray]:
    """An image of the camera ``own`` as ``lens``, at the same pose, shows it, and where it does."""
    scale = min(1.0, lens.fx / own.fx)
    own = own.scaled(scale)
    image = resize(image, own.width, own.height)
    across, down = own.fx / lens.fx, own.fy / lens.fy
    # Pixel centres lie at half-integers here and at integers in OpenCV.
    to_own = np.array(
        [[across, 0.0, own.cx - 0.5 + across * (0.5 - lens.cx)], [0.0, down, own.cy - 0.5 + down * (0.5 - lens.cy)]]
    )
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    size = (lens.width, lens.height)
    seen = cv2.warpAffine(image, to_own, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    u = to_own[0, 0] * np.arange(lens.width) + to_own[0, 2]
    v = to_own[1, 1] * np.arange(lens.height) + to_own[1, 2]
    wide = (u > -0.5 - 1e-6) & (u < own.width - 0.5 + 1e-6)
    high = (v > -0.5 - 1e-6) & (v < own.height - 0.5 + 1e-6)
    return seen, high[:, None] & wide[None, :]


@parallel_kernel
def _coloured(depth, normal, pose, lens, reference, tolerance, poses, lenses, sizes, starts, depths, colours):
    """(H, W, 3) float32 colour and (H, W) uint8 number of captures that see the point."""
    height, width = depth.shape
    image = np.zeros((height, width, 3), np.float32)
    count = np.zeros((height, width), np.uint8)
    half, one = np.float32(0.5), np.float32(1.0)
    for row in prange(height):
        for column in range(width):
            z = depth[row, column]
            if z <= 0.0:
                continue
            rx = (np.float32(column) + half - lens[2]) / lens[0] * z
            ry = (np.float32(row) + half - lens[3]) / lens[1] * z
            px = pose[0, 0] * rx + pose[0, 1] * ry + pose[0, 2] * z + pose[0, 3]
            py = pose[1, 0] * rx + pose[1, 1] * ry + pose[1, 2] * z + pose[1, 3]
            pz = pose[2, 0] * rx + pose[2, 1] * ry + pose[2, 2] * z + pose[2, 3]
            nx, ny, nz = normal[row, column, 0], normal[row, column, 1], normal[row, column, 2]
            seen, chosen, largest = 0, -1, np.float32(-1.0)
            at_u = at_v = np.float32(0.0)
            for j in range(poses.shape[0]):
                cz = poses[j, 2, 0] * px + poses[j, 2, 1] * py + poses[j, 2, 2] * pz + poses[j, 2, 3]
                if cz <= _NEAR_M:
                    continue
                cx = poses[j, 0, 0] * px + poses[j, 0, 1] * py + poses[j, 0, 2] * pz + poses[j, 0, 3]
                cy = poses[j, 1, 0] * px + poses[j, 1, 1] * py + poses[j, 1, 2] * pz + poses[j, 1, 3]
                u = cx / cz * lenses[j, 0] + lenses[j, 2]
                v = cy / cz * lenses[j, 1] + lenses[j, 3]
                if not (u > 0.0 and v > 0.0 and u < sizes[j, 0] and v < sizes[j, 1]):
                    continue
                pixel = starts[j] + np.int64(v) * sizes[j, 0] + np.int64(u)
                if abs(depths[pixel] - cz) > tolerance * cz + PROXY_ROUGHNESS_M:
                    continue
                seen += 1
                # pixels a square metre of the surface has in the capture, but for a constant
                turned = (
                    nx * (poses[j, 0, 0] * cx + poses[j, 1, 0] * cy + poses[j, 2, 0] * cz)
                    + ny * (poses[j, 0, 1] * cx + poses[j, 1, 1] * cy + poses[j, 2, 1] * cz)
                    + nz * (poses[j, 0, 2] * cx + poses[j, 1, 2] * cy + poses[j, 2, 2] * cz)
                )
                size = abs(turned) * lenses[j, 0] * lenses[j, 1] / (cz * cz * cz)
                if j == reference or (size > largest and chosen != reference):
                    chosen, largest, at_u, at_v = j, size, u, v
            if seen == 0:
                continue
            count[row, column] = min(seen, _MOST_CAPTURES)
            wide, high = sizes[chosen, 0], sizes[chosen, 1]
            a = min(max(at_u - half, np.float32(0.0)), np.float32(wide - 1))
            b = min(max(at_v - half, np.float32(0.0)), np.float32(high - 1))
            a0, b0 = np.int64(a), np.int64(b)
            a1, b1 = min(a0 + 1, wide - 1), min(b0 + 1, high - 1)
            fa, fb = a - np.float32(a0), b - np.float32(b0)
            upper, lower = starts[chosen] + b0 * wide, starts[chosen] + b1 * wide
            for c in range(3):
                above = colours[upper + a0, c] * (one - fa) + colours[upper + a1, c] * fa
                below = colours[lower + a0, c] * (one - fa) + colours[lower + a1, c] * fa
                image[row, column, c] = above * (one - fb) + below * fb
    return image, count
