"""First Gaussians: spheres or discs at points, or surface-aligned discs from depth maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import cKDTree

from ...config.training_settings import TrainingSettings
from ...core.cameras import Camera
from ...core.errors import AssetError
from ..asset import SplatAsset
from ..harmonics import SH_BAND_0
from ..quaternions import from_rotation, principal_axes
from .local_planes import local_planes

_POINT_OPACITY = 0.1
_NEIGHBOURS = 3
_SCALE_BOUNDS_M = (0.002, 0.3)

_POINT_DISC_THICKNESS = 0.25
"""Standard deviation of a point's disc along the normal over that along the surface."""
_PLANE_OPACITY = 0.9
"""Opacity of a disc whose neighbours lie in a plane..."""
_NO_PLANE = 0.5
"""... falling to a sphere's at this thickness, which nine in ten points of a mere cloud exceed."""

_DISC_OPACITY = 0.95
_DISC_SIGMA = 0.6
"""Standard deviation of a disc over the spacing of the sampled pixels: neighbours overlap."""
_DISC_THICKNESS = 0.12
"""Standard deviation along the normal over the pixels' spacing, seen head-on."""
_LARGEST_STRETCH = 3.0
"""A disc on a slanted surface is at most this much longer than one seen head-on."""
_SMALLEST_COSINE = 0.15
_TURNED_COSINE, _KEPT_COSINE = 0.2, 0.3
"""Normals nearer to edge-on than the first are turned to about the second: they are noise."""
_NORMAL_RADIUS_PX = 3
_NEAREST_M = 0.2

_AGREEMENT = 0.02
_AGREEMENT_M = 0.01
"""Two views see one surface when their depths differ by less than 2 % and 1 cm."""
_FINER = 1.05
"""A view sees a surface finer when its footprint is smaller by more than this factor..."""
_AS_FINE = 1.1
"""... and among views that differ by less than this the first one keeps it."""
_EDGE_PX = 3


@dataclass(frozen=True)
class DepthView:
    """A photograph with its depth, to be turned into Gaussians.

    ``image`` (H, W, 3) float32 in [0, 1]; ``depth`` (H, W) planar metres, 0 unknown; every
    ``stride_px``-th pixel a side becomes a Gaussian in the ``detailed_share`` of the image whose
    colours change most, every second of those elsewhere, where ``mask`` (H, W) bool allows.
    ``weight`` is how much the photograph counts, once an asset is trained on it.
    """

    camera: Camera
    depth: np.ndarray
    image: np.ndarray
    stride_px: int
    mask: np.ndarray | None = None
    detailed_share: float = 1.0
    weight: float = 1.0


def from_points(
    points: np.ndarray, colours: np.ndarray, settings: TrainingSettings, rng: np.random.Generator
) -> SplatAsset:
    """Gaussians at ``points`` (P, 3) metres, as ``settings.first_gaussians`` says.

    ``spheres`` are those of 3DGS (Kerbl et al. 2023): their standard deviation is the mean
    distance of the three nearest neighbours, opacity 0.1, rotations random. ``discs`` are as
    wide, but lie in the plane of their neighbours and are a quarter as thick; the more clearly
    there is a plane, the nearer is their opacity to 0.9. ``colours`` (P, 3) are uint8 or float
    in [0, 1]. A random choice of ``settings.max_gaussians`` is kept. Raises AssetError for
    fewer than four points.
    """
    points = np.asarray(points, np.float64)
    if len(points) <= _NEIGHBOURS:
        raise AssetError(f"{len(points)} points are too few to start from", cure="Give at least four.")
    colours = np.asarray(colours)
    colours = colours / 255.0 if colours.dtype == np.uint8 else colours
    if len(points) > settings.max_gaussians:
        chosen = np.sort(rng.choice(len(points), settings.max_gaussians, replace=False))
        points, colours = points[chosen], colours[chosen]
    distances, _ = cKDTree(points).query(points, k=_NEIGHBOURS + 1)
    sigma_m = np.clip(distances[:, 1:].mean(axis=1), *_SCALE_BOUNDS_M)
    sigmas_m = np.repeat(sigma_m[:, None], 3, axis=1)
    if settings.first_gaussians == "discs":
        axes, thickness = local_planes(points)
        sigmas_m[:, 0] *= _POINT_DISC_THICKNESS
        quaternions = from_rotation(axes)
        clear = np.clip(1.0 - thickness / _NO_PLANE, 0.0, 1.0)
        opacity: np.ndarray | float = _POINT_OPACITY + (_PLANE_OPACITY - _POINT_OPACITY) * clear
    else:
        quaternions = rng.normal(size=(len(points), 4))
        opacity = _POINT_OPACITY
    return gaussians(points, sigmas_m, quaternions, opacity, colours).with_degree(settings.sh_degree)


def from_depth(
    camera: Camera, depth: np.ndarray, image: np.ndarray, stride_px: int, mask: np.ndarray | None = None
) -> SplatAsset:
    """Flat discs on the surface that a depth map shows, one for each ``stride_px`` square.

    ``depth`` (H, W) planar metres, 0 unknown; ``image`` (H, W, 3) float32 in [0, 1]. A disc
    lies in the tangent plane, covers its pixels' footprint there, and has the square's mean
    colour. Degree 0.
    """
    return _discs(DepthView(camera, depth, image, stride_px, mask))[0]


def merge_views(views: Sequence[DepthView]) -> SplatAsset:
    """The discs of all views, each surface from the view that sees it finest.

    A disc is dropped when another view's depth agrees with it there and that view's
    footprint on the surface is smaller; of equal ones the first stays.
    """
    if not views:
        return SplatAsset.empty()
    parts = [_discs(view) for view in views]
    footprints = [_footprint_map(view) for view in views]
    merged = SplatAsset.empty()
    for index, (asset, footprint_m) in enumerate(parts):
        kept = np.ones(len(asset), bool)
        for other, view in enumerate(views):
            if other != index:
                kept &= ~_seen_finer(asset.means, footprint_m, view, footprints[other], other < index)
        merged = merged.concatenated(asset.subset(kept))
    return merged


def gaussians(
    means: np.ndarray, sigmas_m: np.ndarray, quaternions: np.ndarray, opacity: float | np.ndarray, colours: np.ndarray
) -> SplatAsset:
    """Gaussians of degree 0 from plain quantities: ``means`` (N, 3) and ``sigmas_m`` (N, 3) in
    metres, ``quaternions`` (N, 4) wxyz, ``opacity`` one or (N,), ``colours`` (N, 3) in [0, 1]."""
    opacity = np.broadcast_to(np.asarray(opacity, np.float64), len(means))
    return SplatAsset(
        means=means,
        log_scales=np.log(sigmas_m),
        quaternions=quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True),
        logit_opacities=np.log(opacity / (1.0 - opacity)),
        sh=((colours - 0.5) / SH_BAND_0)[:, None, :],
    )


def _discs(view: DepthView) -> tuple[SplatAsset, np.ndarray]:
    """The view's discs and the footprints (n,) of its strides on the surface there, metres."""
    normals, usable = _surface(view)
    if view.detailed_share >= 1.0:
        return _even_discs(view, view.stride_px, normals, usable)
    detailed = _detailed(view.image, view.stride_px, view.detailed_share)
    fine, fine_m = _even_discs(view, view.stride_px, normals, usable & detailed)
    coarse, coarse_m = _even_discs(view, 2 * view.stride_px, normals, usable & ~detailed)
    return fine.concatenated(coarse), np.concatenate([fine_m, coarse_m])


def _detailed(image: np.ndarray, stride_px: int, share: float) -> np.ndarray:
    """(H, W) bool: the ``share`` of the squares of two strides whose four quarters differ most.

    That difference is what one Gaussian in place of four would lose.
    """
    colours = cv2.blur(np.asarray(image, np.float32), (stride_px, stride_px))
    colours = colours[stride_px // 2 :: stride_px, stride_px // 2 :: stride_px]
    rows, columns = colours.shape[0] // 2, colours.shape[1] // 2
    quarters = colours[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2, 3)
    difference = quarters.var(axis=(1, 3)).mean(axis=-1)
    chosen = difference > np.quantile(difference, 1.0 - share) if difference.size else difference > 0.0
    detailed = np.ones(image.shape[:2], bool)  # what is left at the rim holds no whole square
    whole = chosen.repeat(2 * stride_px, axis=0).repeat(2 * stride_px, axis=1)
    detailed[: whole.shape[0], : whole.shape[1]] = whole
    return detailed


def _even_discs(view: DepthView, stride: int, normals: np.ndarray, usable: np.ndarray) -> tuple[SplatAsset, np.ndarray]:
    """One disc for each ``usable`` square of ``stride``, and the footprints of the view's strides."""
    camera = view.camera
    rays = camera.rays()
    depth = np.asarray(view.depth, np.float64)
    squares = (slice(stride // 2, None, stride),) * 2
    image = cv2.blur(np.asarray(view.image, np.float32), (stride, stride))
    usable = usable[squares]
    ray, z, normal = rays[squares][usable], depth[squares][usable], normals[squares][usable]

    direction = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    cosine = (normal * direction).sum(axis=1)
    turn = np.where(cosine > -_TURNED_COSINE, cosine + _KEPT_COSINE, 0.0)
    normal = normal - turn[:, None] * direction
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)

    # How the surface point moves when the pixel moves by a stride right and down.
    slope = np.minimum((normal * ray).sum(axis=1), -_SMALLEST_COSINE)
    step_u, step_v = stride / camera.fx, stride / camera.fy
    along_u = z[:, None] * (np.array([step_u, 0, 0]) - ray * (normal[:, 0] * step_u / slope)[:, None])
    along_v = z[:, None] * (np.array([0, step_v, 0]) - ray * (normal[:, 1] * step_v / slope)[:, None])
    # The square's middle is the sampled pixel's centre, or its corner where the stride is even.
    middle = ray * z[:, None] - (0.5 / stride if stride % 2 == 0 else 0.0) * (along_u + along_v)
    spread = along_u[:, :, None] * along_u[:, None, :] + along_v[:, :, None] * along_v[:, None, :]
    variances, axes = principal_axes(spread)
    head_on_m = z * step_u
    lengths = np.minimum(np.sqrt(np.maximum(variances, 0.0)), _LARGEST_STRETCH * head_on_m[:, None])
    sigmas_m = lengths * _DISC_SIGMA
    sigmas_m[:, 0] = head_on_m * _DISC_THICKNESS
    world_axes = camera.world_from_camera[:3, :3] @ axes
    asset = gaussians(
        means=middle @ camera.world_from_camera[:3, :3].T + camera.centre,
        sigmas_m=np.maximum(sigmas_m, 1e-5),
        quaternions=from_rotation(world_axes) if len(z) else np.ones((0, 4)),
        opacity=_DISC_OPACITY,
        colours=image[squares][usable].astype(np.float64),
    )
    facing = np.maximum(-slope / np.linalg.norm(ray, axis=1), _SMALLEST_COSINE)
    return asset, z * (view.stride_px / camera.fx) / facing


def _surface(view: DepthView) -> tuple[np.ndarray, np.ndarray]:
    """Normals (H, W, 3) as ``surface_normals`` has them, and (H, W) bool where a disc may lie."""
    depth = np.asarray(view.depth, np.float64)
    normals = surface_normals(view.camera, depth)
    usable = (depth > _NEAREST_M) & (np.linalg.norm(normals, axis=-1) > 0.5)
    if view.mask is not None:
        usable &= view.mask
    return normals, usable


def surface_normals(camera: Camera, depth: np.ndarray) -> np.ndarray:
    """(H, W, 3) float64 unit normals in the camera frame, towards the camera; 0 at the border.

    On each axis the difference to the neighbour that is nearer in depth is taken, so that
    normals do not bend at a silhouette.
    """
    smooth = cv2.medianBlur(depth.astype(np.float32), 5).astype(np.float64)
    points = camera.rays() * smooth[..., None]
    tangents = []
    for axis in (1, 0):
        ahead = np.roll(points, -_NORMAL_RADIUS_PX, axis) - points
        behind = points - np.roll(points, _NORMAL_RADIUS_PX, axis)
        tangents.append(np.where(np.abs(ahead[..., 2:]) < np.abs(behind[..., 2:]), ahead, behind))
    normals = np.cross(tangents[1], tangents[0])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True) + 1e-12
    normals *= np.where((normals * points).sum(axis=-1, keepdims=True) > 0.0, -1.0, 1.0)
    inside = np.zeros(depth.shape, bool)
    r = _NORMAL_RADIUS_PX
    inside[r:-r, r:-r] = True
    return np.where((inside & (smooth > 0.0))[..., None], normals, 0.0)


def _footprint_map(view: DepthView) -> np.ndarray:
    """(H, W) metres a stride covers on the surface; infinite where there is no disc."""
    rays = view.camera.rays()
    depth = np.asarray(view.depth, np.float64)
    normals, usable = _surface(view)
    cosine = np.abs((normals * rays).sum(axis=-1)) / np.linalg.norm(rays, axis=-1)
    footprint_m = depth / view.camera.fx * view.stride_px / np.maximum(cosine, _SMALLEST_COSINE)
    return np.where(usable, footprint_m, np.inf)


def _seen_finer(
    means: np.ndarray, footprint_m: np.ndarray, view: DepthView, footprints: np.ndarray, first: bool
) -> np.ndarray:
    """(n,) bool: which discs ``view`` sees, at the same depth, with a smaller footprint."""
    pixels, depth = view.camera.project(means)
    inside = view.camera.sees(pixels, depth, margin_px=_EDGE_PX) & (depth > _NEAREST_M)
    column, row = np.where(inside[:, None], pixels, 0.0).astype(np.int64).T
    agrees = np.abs(view.depth[row, column] - depth) < _AGREEMENT * depth + _AGREEMENT_M
    other_m = footprints[row, column]
    finer = other_m * _FINER < footprint_m
    if first:
        finer |= other_m < footprint_m * _AS_FINE / _FINER
    return inside & agrees & finer
