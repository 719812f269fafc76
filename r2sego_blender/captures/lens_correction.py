"""Captures through another lens than the given one, and held-out views of the same lens brought along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from ..core.errors import CaptureError
from .capture import Capture
from .lenses.distortion import COEFFICIENTS
from .lenses.lens import Lens
from .poses.photographs import upright_size

# Places a side of the photograph at which a lens is fitted, and how well it has to fit, in longest sides.
_SAMPLES = 15
_FIT = 1e-3
# A held-out view has the lens of a capture where its intrinsics are so near, in longest sides.
_SAME_LENS = 0.03


def photograph_lens(capture: Capture, *, sized: bool = True) -> Lens:
    """The lens of the photograph as it was taken; a pinhole where none is known to distort.

    In pixels of the upright file, or without ``sized`` of the capture's camera where it is a pinhole.
    """
    if capture.lens is not None:
        return capture.lens
    camera = capture.camera
    lens = Lens(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
    return lens.scaled_to(*upright_size(capture.image_path)) if sized else lens


def corrected(capture: Capture, terms: np.ndarray) -> Capture:
    """The capture with its lens corrected by ``terms`` (``bundle_adjustment.LENS_TERMS``) of its camera's image.

    Raises CaptureError where no lens of the given model has this distortion, or it cannot be undone.
    """
    camera, given = capture.camera, photograph_lens(capture)
    zoom, right, down, k1, k2 = map(float, terms)
    bent = Lens(
        camera.width,
        camera.height,
        camera.fx * np.exp(zoom),
        camera.fy * np.exp(zoom),
        camera.cx + camera.fx * right,
        camera.cy + camera.fy * down,
        (k1, k2) if k1 or k2 else (),
    )
    if capture.lens is None:
        lens = bent.scaled_to(given.width, given.height)
    else:
        lens = _fitted(capture, given, bent)
    given_lens = capture.given_lens or given
    if lens.plain:
        whole = replace(camera, fx=bent.fx, fy=bent.fy, cx=bent.cx, cy=bent.cy)
        return replace(capture, camera=whole, given_lens=given_lens)
    working = lens.straight(camera.world_from_camera).fitted(max(camera.width, camera.height))
    return replace(capture, camera=working, lens=lens, given_lens=given_lens)


def brought_along(view: Capture, captures: Sequence[Capture]) -> Capture:
    """A view that was read with the captures' given intrinsics, through the lens that was found for these.

    The nearest given lens counts. Without any as near as a few per cent, or where the lens that was found is
    nearer still, the view stays as it is.
    """
    changed = [capture for capture in captures if capture.given_lens is not None]
    own = photograph_lens(view, sized=False)
    nearest = min(changed, key=lambda capture: _apart(own, capture.given_lens), default=None)
    if nearest is None or nearest.given_lens is None or _apart(own, nearest.given_lens) > _SAME_LENS:
        return view
    given = nearest.given_lens.scaled_to(own.width, own.height)
    found = photograph_lens(nearest, sized=False).scaled_to(own.width, own.height)
    if _apart(own, found) < _apart(own, given):  # it was read with the right ones
        return view
    lens = replace(
        found,
        fx=own.fx * found.fx / given.fx,
        fy=own.fy * found.fy / given.fy,
        cx=own.cx + found.cx - given.cx,
        cy=own.cy + found.cy - given.cy,
    )
    longest = max(view.camera.width, view.camera.height)
    camera = lens.straight(view.camera.world_from_camera).fitted(longest)
    return replace(view, camera=camera, lens=None if lens.plain else lens)


def _apart(lens: Lens, other: Lens | None) -> float:
    """How far intrinsics are apart, in longest sides; infinite where the shapes or distortions differ."""
    if other is None or abs(np.log(lens.width / lens.height * other.height / other.width)) > 0.01:
        return np.inf
    if lens.distorts != other.distorts or (lens.distorts and lens.model != other.model):
        return np.inf
    unit = max(lens.width, lens.height)
    other = other.scaled_to(lens.width, lens.height)
    return max(abs(getattr(lens, name) - getattr(other, name)) for name in ("fx", "fy", "cx", "cy")) / unit


def _fitted(capture: Capture, given: Lens, bent: Lens) -> Lens:
    """The lens of ``given``'s model that shows rays where the photograph has what ``bent`` says they are.

    ``bent`` is of the image of the capture's camera, which ``given`` straightened.
    """
    camera = capture.camera
    u, v = np.meshgrid(np.linspace(0.0, camera.width, _SAMPLES), np.linspace(0.0, camera.height, _SAMPLES))
    pixels = np.stack([u, v], axis=-1).reshape(-1, 2)
    targets = given.project((pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy])
    rays = bent.rays(pixels)
    shown = np.isfinite(rays).all(axis=1) & np.isfinite(targets).all(axis=1)
    count = min(COEFFICIENTS[given.model], max(len(given.distortion), 4 if given.model != "fov" else 1))
    coefficients = (*given.distortion, *[0.0] * count)[:count]

    def lens(unknown: np.ndarray) -> Lens:
        fx, fy, cx, cy = unknown[:4] * given.fx
        return replace(given, fx=fx, fy=fy, cx=cx, cy=cy, distortion=tuple(map(float, unknown[4:])))

    def off(unknown: np.ndarray) -> np.ndarray:
        return np.nan_to_num((lens(unknown).project(rays[shown]) - targets[shown]).ravel(), nan=1e3)

    zoom = bent.fx / camera.fx
    start = [given.fx * zoom, given.fy * zoom, given.cx, given.cy]
    found = least_squares(off, [*(np.array(start) / given.fx), *coefficients])
    if np.sqrt(2.0 * np.mean(found.fun**2)) > _FIT * max(given.width, given.height):
        raise CaptureError(
            f"no lens of the model {given.model} has the distortion that the photographs show",
            where="camera distortion",
            cure="Calibrate the camera again, or give undistorted photographs.",
        )
    return lens(found.x)
