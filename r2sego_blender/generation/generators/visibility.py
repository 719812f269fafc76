"""How far each pixel of a capture may be trusted to show the proxy surface it falls on."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from ...config.settings import GenerationSettings

# A depth edge may be half a pixel off its photograph, and a pixel on it mixes both sides:
# the foreground's side is used only where no capture sees that surface away from an edge.
_FOREGROUND_EDGE_TRUST = 0.1
_FOREGROUND_EDGE_PX = 1
# Where the capture's own depth contradicts the proxy, its colour belongs to another surface.
_CONTRADICTED_TRUST = 0.02


def depth_edges(depth: np.ndarray, jump: float) -> tuple[np.ndarray, np.ndarray]:
    """The near and the far pixels (H, W) bool of a depth map's discontinuities.

    Neighbours are a discontinuity when their inverse depths differ by more than ``jump``,
    relative, from what both sides' slopes foretell: inverse depth is linear over a plane,
    so neither slanted planes nor creases are edges. Unknown depth (0) is infinitely far.
    """
    inverse = np.zeros(depth.shape, np.float32)
    np.divide(1.0, depth, out=inverse, where=depth > 0.0, dtype=np.float32)
    near, far = np.zeros(depth.shape, bool), np.zeros(depth.shape, bool)
    for axis in (0, 1):
        values, near_side, far_side = (np.moveaxis(a, axis, 1) for a in (inverse, near, far))
        padded = np.pad(values, ((0, 0), (1, 1)), mode="reflect", reflect_type="odd")
        bend = np.abs(padded[:, :-2] - 2.0 * values + padded[:, 2:])
        left, right = values[:, :-1], values[:, 1:]
        # the image's own border pixels have no second neighbour: they bend by definition 0
        bend[:, 0], bend[:, -1] = bend[:, 1], bend[:, -2]
        edge = np.minimum(bend[:, :-1], bend[:, 1:]) > jump * np.maximum(left, right)
        left_near = edge & (left > right)
        right_near = edge & (right > left)
        near_side[:, :-1] |= left_near
        near_side[:, 1:] |= right_near
        far_side[:, :-1] |= right_near
        far_side[:, 1:] |= left_near
    return near, far


def capture_trust(depth: np.ndarray, observed: np.ndarray | None, settings: GenerationSettings) -> np.ndarray:
    """(H, W) float32 in [0, 1]: how far a capture's pixels show the surface of ``depth``.

    ``depth`` (H, W) is the proxy's in the capture, ``observed`` the capture's own reliable
    depth (0 = unknown) or None. Background within ``edge_erosion_px`` of a foreground edge
    gets 0: a slightly wrong outline would print the foreground's colour on it.
    """
    jump = settings.depth_tolerance
    near, far = depth_edges(depth, jump)
    trust = np.ones(depth.shape, np.float32)
    behind = _extreme_nearby(np.where(far, depth, 0.0), _FOREGROUND_EDGE_PX, cv2.dilate)
    trust[behind > depth * (1.0 + jump)] = _FOREGROUND_EDGE_TRUST
    trust[(near | far) & (depth > 0.0)] = _FOREGROUND_EDGE_TRUST
    infinity = np.float32(np.inf)
    before = _extreme_nearby(np.where(near, depth, infinity), settings.edge_erosion_px, cv2.erode)
    trust[before < depth * (1.0 - jump)] = 0.0
    if observed is not None:
        contradicted = np.abs(observed - depth) > 2.0 * settings.depth_tolerance * depth
        trust[(observed > 0.0) & contradicted] *= _CONTRADICTED_TRUST
    trust[depth <= 0.0] = 0.0
    return trust


def _extreme_nearby(values: np.ndarray, radius_px: int, operation: Callable[..., np.ndarray]) -> np.ndarray:
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius_px + 1, 2 * radius_px + 1))
    return operation(values.astype(np.float32), disc, borderType=cv2.BORDER_REPLICATE)
