"""Points that a person shows in photographs, found in the room. NumPy alone, for Blender too."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ...core.cameras import Camera
from ...core.errors import CaptureError

if TYPE_CHECKING:
    from ..capture import Capture

_NEAREST_POINTS = 12
_LIFT_RADIUS = 0.12  # of the image's longest side
_WORST_CONDITION = 1e8


class View(Protocol):
    """What is asked of a capture: ``Capture`` and ``RegisteredView`` have it."""

    @property
    def name(self) -> str: ...
    @property
    def camera(self) -> Camera: ...


class Sparse(Protocol):
    """What is asked of ``SparsePoints``."""

    @property
    def points(self) -> np.ndarray: ...
    @property
    def visibility(self) -> np.ndarray: ...


def pointed_at(
    captures: Sequence[Capture], photo: str, pixels: Sequence[Sequence[float]], where: str
) -> tuple[int, np.ndarray]:
    """The capture that ``photo`` names, with or without suffix, and its working pixels (n, 2).

    ``pixels`` are those of the upright file. Raises CaptureError for another name and for
    pixels outside.
    """
    files = [(capture.name, capture.image_path) for capture in captures]
    index, given, shape = in_photograph(files, photo, pixels, where)
    return index, captures[index].working_pixels(given, shape)


def in_photograph(
    files: Sequence[tuple[str, Path]], photo: str, pixels: Sequence[Sequence[float]], where: str
) -> tuple[int, np.ndarray, tuple[int, int]]:
    """Which of ``files``, names with paths, is ``photo``; the pixels (n, 2); the file's (height, width).

    Errors as for ``pointed_at``.
    """
    from ..poses.photographs import upright_size  # reads images, which Blender's Python does not

    names = [name for name, _ in files]
    composed, photo = [unicodedata.normalize("NFC", name) for name in names], unicodedata.normalize("NFC", photo)
    named = [i for i, name in enumerate(composed) if name == photo]
    named = named or [i for i, name in enumerate(composed) if Path(name).stem == photo]
    if len(named) != 1:
        raise CaptureError(
            f"there {'is no capture' if not named else 'are several captures'} '{photo}'",
            where=where,
            cure=f"Name one of {', '.join(names)}.",
        )
    width, height = upright_size(files[named[0]][1])
    given = np.asarray(pixels, np.float64)
    if not np.isfinite(given).all() or (given < 0).any() or (given > [width, height]).any():
        raise CaptureError(
            f"a pixel lies outside the {width}x{height} photograph",
            where=f"{where}, {photo}",
            cure="Give pixels of the upright photograph at its full size.",
        )
    return named[0], given, (height, width)


def lifted(capture: View, sparse: Sparse, index: int, pixel: np.ndarray) -> np.ndarray:
    """The point (3,) seen at a pixel, from the surface that the nearest sparse points span."""
    camera = capture.camera
    places, depth = camera.project(sparse.points)
    usable = sparse.visibility[:, index] & (depth > 0)
    distance = np.where(usable, np.linalg.norm(places - pixel, axis=1), np.inf)
    near = np.argsort(distance, kind="stable")[:_NEAREST_POINTS]
    near = near[distance[near] <= _LIFT_RADIUS * max(camera.width, camera.height)]
    if len(near) < 3:
        raise CaptureError(
            f"nothing was measured near pixel {tuple(round(float(v)) for v in pixel)}",
            where=capture.name,
            cure="Choose points on textured surfaces that other photographs see too.",
        )
    # On a plane the inverse depth is linear in the pixels.
    offset = (places[near] - pixel) / max(camera.width, camera.height)
    design = np.column_stack([offset, np.ones(len(near))])
    inverse, weights = 1.0 / depth[near], np.ones(len(near))
    for _ in range(10):
        # The slope is held back a little, for points that lie in a row do not tell it.
        system = design.T @ (weights[:, None] * design) + np.diag([1e-3, 1e-3, 0.0])
        fit = np.linalg.solve(system, design.T @ (weights * inverse))
        residual = np.abs(inverse - design @ fit)
        weights = 1.0 / np.maximum(residual, 0.002 * np.median(inverse))
        weights /= weights.mean()
    lowest, highest = inverse.min() / 1.5, inverse.max() * 1.5
    z = 1.0 / float(np.clip(fit[2], lowest, highest))
    local = np.array([(pixel[0] - camera.cx) / camera.fx * z, (pixel[1] - camera.cy) / camera.fy * z, z])
    return camera.world_from_camera[:3, :3] @ local + camera.centre


def intersection(cameras: Sequence[Camera], pixels: Sequence[np.ndarray]) -> np.ndarray:
    """The point (3,) nearest to the rays through one pixel (2,) of each camera."""
    system, target = np.zeros((3, 3)), np.zeros(3)
    for camera, pixel in zip(cameras, pixels, strict=True):
        across = _across(camera, pixel)
        system += across
        target += across @ camera.centre
    if np.linalg.cond(system) > _WORST_CONDITION:
        raise CaptureError(
            "the point was seen from one place only",
            where="photographs",
            cure="Show it in photographs from places a step apart.",
        )
    return np.linalg.solve(system, target)


def intersection_covariance(
    cameras: Sequence[Camera], pixels: Sequence[np.ndarray], point: np.ndarray, sigma_px: float
) -> np.ndarray:
    """The (3, 3) covariance of an ``intersection`` whose pixels are sure to ``sigma_px``."""
    information = np.zeros((3, 3))
    for camera, pixel in zip(cameras, pixels, strict=True):
        sigma = np.linalg.norm(point - camera.centre) * sigma_px / camera.fx
        information += _across(camera, pixel) / sigma**2
    return np.linalg.inv(information)


def _across(camera: Camera, pixel: np.ndarray) -> np.ndarray:
    """The (3, 3) projection onto the plane across the ray through a pixel."""
    u, v = pixel
    ray = camera.world_from_camera[:3, :3] @ [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0]
    ray /= np.linalg.norm(ray)
    return np.eye(3) - np.outer(ray, ray)
