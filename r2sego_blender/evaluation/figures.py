"""Pictures for the report: comparison strips, the proxy seen from above, camera maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from ..core.cameras import Camera
from ..core.images import load_image_uint8, resize, to_uint8
from ..geometry.proxy.proxy import PROVENANCE_COLOURS, GeometryProxy, Provenance
from ..geometry.visibility.rasterizer import MeshRasterizer

BACKGROUND = (0.965, 0.957, 0.941)
CAPTURE_INK = (40, 62, 92)
CANDIDATE_INK = (120, 116, 108)
CHOSEN_INK = (196, 64, 38)
TO_TAKE_INK = (34, 128, 74)

_CAMERA_HEIGHT_M = 200.0
"""A camera so far above has rays that are parallel to within 1.5 degrees over a room."""

_CUT_BELOW_TOP_M = 0.35
"""Faces this near to the proxy's top are its ceiling; they are left out."""

_SUPERSAMPLING = 2

_CONTOUR_M = 0.06
"""Steps in height larger than this are outlined on the plan."""

_FADED = 0.45
"""How far the plan goes over into the background where cameras are drawn on it."""

_MASK_TINT, _MASK_OPACITY = (235, 60, 160), 110

_KEY_LIGHT = np.array([-0.35, -0.5, 0.79])


def strip(images: Sequence[np.ndarray], gap_px: int = 8) -> np.ndarray:
    """Images (h, w, 3) side by side at the first one's height, on a light ground; float32."""
    height = images[0].shape[0]
    scaled = [resize(i.astype(np.float32), round(i.shape[1] * height / i.shape[0]), height) for i in images]
    width = sum(image.shape[1] for image in scaled) + gap_px * (len(scaled) - 1)
    joined = np.empty((height, width, 3), np.float32)
    joined[:] = BACKGROUND
    left = 0
    for image in scaled:
        joined[:, left : left + image.shape[1]] = image
        left += image.shape[1] + gap_px
    return joined


def depth_picture(depth: np.ndarray) -> np.ndarray:
    """A planar depth map (H, W), metres, 0 = unknown, as (H, W, 3): near light, far dark blue."""
    known = depth > 0
    picture = np.empty((*depth.shape, 3), np.float32)
    picture[:] = (0.55, 0.16, 0.12)
    if not known.any():
        return picture
    near, far = np.percentile(1.0 / depth[known], (98, 2))
    closeness = np.clip((1.0 / depth[known] - far) / max(near - far, 1e-9), 0.0, 1.0)[:, None]
    picture[known] = closeness * (0.98, 0.94, 0.84) + (1.0 - closeness) * (0.07, 0.13, 0.24)
    return picture


@dataclass(frozen=True)
class TopView:
    """A picture of the proxy from above, x to the right and y up, and where a point lies in it."""

    image: np.ndarray
    camera: Camera

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """(..., 2) picture coordinates of world points (..., 3)."""
        return self.camera.project(points)[0]


def top_view(proxy: GeometryProxy, width_px: int = 960) -> TopView:
    """The proxy from above without its ceiling, each face in its provenance's colour.

    The camera stands 200 m up, so that the picture is a plan to within a few centimetres.
    """
    vertices = np.asarray(proxy.vertices, np.float64)
    faces = proxy.faces
    if len(faces) == 0:
        camera = _plan_camera(np.array([-1.0, -1.0, 0.0]), np.array([1.0, 1.0, 0.0]), width_px)
        return TopView(np.full((*camera.shape, 3), BACKGROUND, np.float32), camera)
    low, high = np.percentile(vertices, 0.2, axis=0), np.percentile(vertices, 99.8, axis=0)
    below_ceiling = vertices[faces, 2].min(axis=1) < max(high[2] - _CUT_BELOW_TOP_M, low[2] + 0.5)
    faces, provenance = faces[below_ceiling], proxy.provenance[below_ceiling]
    camera = _plan_camera(low, high, width_px)
    large = camera.scaled(_SUPERSAMPLING)
    buffers = MeshRasterizer(vertices, faces).render(large)
    colours = _shaded(vertices, faces, provenance)
    image = buffers.of_face(colours) * _height_shade(buffers.depth)[..., None]
    image[buffers.face < 0] = BACKGROUND
    return TopView(resize(image.astype(np.float32), camera.width, camera.height), camera)


def camera_map(
    plan: TopView,
    captures: Sequence[Camera],
    candidates: np.ndarray,
    chosen: np.ndarray,
    to_take: Sequence[Camera] = (),
) -> np.ndarray:
    """The ``plan``, faded, with the captures' frusta, every candidate position, the target views' frusta
    and those of photographs to take.

    ``candidates`` (M, 4, 4) world_from_camera; ``chosen`` (<= M,) indices into them. Returns
    (H, W, 3) float32.
    """
    faded = plan.image * (1.0 - _FADED) + np.array(BACKGROUND, np.float32) * _FADED
    large = TopView(faded, plan.camera.scaled(_SUPERSAMPLING))
    canvas = Image.fromarray(to_uint8(resize(faded, large.camera.width, large.camera.height)))
    draw = ImageDraw.Draw(canvas)
    if len(candidates):
        for x, y in large.pixels(np.asarray(candidates)[:, :3, 3]):
            draw.ellipse((x - 3, y - 3, x + 3, y + 3), fill=CANDIDATE_INK)
    for index in np.asarray(chosen, int):
        _frustum(draw, large, np.asarray(candidates[index]), 0.35, CHOSEN_INK)
    for camera in captures:
        _frustum(draw, large, camera.world_from_camera, 0.5, CAPTURE_INK)
    for camera in to_take:
        _frustum(draw, large, camera.world_from_camera, 0.7, TO_TAKE_INK)
    drawn = np.asarray(canvas, np.float32) / 255.0
    return resize(drawn, plan.camera.width, plan.camera.height)


def save_figure(path: Path, picture: np.ndarray | Path, quality: int = 90) -> None:
    """Write a picture, (H, W, 3) float [0, 1] or uint8 or another image file, as a JPEG.

    Raises OSError, and CaptureError for a file that is no image.
    """
    if isinstance(picture, Path):
        picture = load_image_uint8(picture)
    pixels = picture if picture.dtype == np.uint8 else to_uint8(picture)
    Image.fromarray(pixels).convert("RGB").save(path, "JPEG", quality=quality)


def save_mask(path: Path, mask: np.ndarray) -> None:
    """Write (H, W) bool as a PNG to be laid over pictures: clear where it is False, else tinted, with an outline."""
    inner = mask.copy()
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        inner &= np.roll(mask, step, axis)
    image = Image.fromarray(mask.astype(np.uint8) + (mask & ~inner).astype(np.uint8))
    image.putpalette([0, 0, 0, *_MASK_TINT, *_MASK_TINT])
    image.save(path, "PNG", transparency=bytes([0, _MASK_OPACITY, 255]), optimize=True)


def _plan_camera(low: np.ndarray, high: np.ndarray, width_px: int) -> Camera:
    """A far camera that looks straight down, y up in the picture, fitted with a margin."""
    margin_m = 0.25
    size = high[:2] - low[:2] + 2 * margin_m
    centre = (low[:2] + high[:2]) / 2
    height_px = int(np.clip(round(width_px * size[1] / size[0]), width_px // 4, 2 * width_px))
    distance_m = _CAMERA_HEIGHT_M - float(low[2])
    focal_px = min(width_px / size[0], height_px / size[1]) * distance_m
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = centre[0], centre[1], _CAMERA_HEIGHT_M
    return Camera(width_px, height_px, focal_px, focal_px, width_px / 2, height_px / 2, pose)


def _shaded(vertices: np.ndarray, faces: np.ndarray, provenance: np.ndarray) -> np.ndarray:
    """(F, 3) float32: each face's provenance colour under a soft light from above."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    light = 0.62 + 0.38 * np.abs(normals @ _KEY_LIGHT)
    palette = np.array([PROVENANCE_COLOURS[kind] for kind in Provenance])
    return (palette[provenance] * light[:, None]).astype(np.float32)


def _height_shade(depth: np.ndarray) -> np.ndarray:
    """(H, W): higher surfaces lighter, and dark contours where the height jumps."""
    seen = depth > 0
    if not seen.any():
        return np.ones_like(depth)
    floor, top = np.percentile(depth[seen], (99, 1))
    height = np.clip((floor - depth) / max(floor - top, 1e-6), 0.0, 1.0)
    shade = 0.84 + 0.16 * height
    for axis in (0, 1):
        jump = np.abs(np.diff(depth, axis=axis)) > _CONTOUR_M
        before, after = [slice(None)] * 2, [slice(None)] * 2
        before[axis], after[axis] = slice(None, -1), slice(1, None)
        shade[tuple(before)][jump] *= 0.6
        shade[tuple(after)][jump] *= 0.6
    return shade


def _frustum(
    draw: ImageDraw.ImageDraw, plan: TopView, pose: np.ndarray, length_m: float, ink: tuple[int, int, int]
) -> None:
    """A camera on the plan: its centre, and a triangle that opens where it looks."""
    forward, right = pose[:2, 2], pose[:2, 0]
    heading = np.append(forward / max(np.linalg.norm(forward), 1e-9), 0.0)
    across = np.append(right, 0.0)
    centre = pose[:3, 3]
    corners = [centre, centre + length_m * (heading - 0.6 * across), centre + length_m * (heading + 0.6 * across)]
    outline = [tuple(point) for point in plan.pixels(np.array(corners))]
    draw.line([*outline, outline[0]], fill=ink, width=4, joint="curve")
    x, y = outline[0]
    draw.ellipse((x - 6, y - 6, x + 6, y + 6), fill=ink)
