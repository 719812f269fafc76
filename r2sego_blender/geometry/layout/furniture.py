"""What stands on the floor before the walls, told by its colours, and how far it is by where its foot is.

Colours that are usual on the floor, on each wall and the ceiling make these; what else is connected, stands on the
floor and rises is furniture. Each column of an upright picture shows one surface of it, over its lowest contact with
the floor (stixels; Badino, Franke and Pfeiffer, DAGM 2009; that a contact tells the distance: Hoiem, Efros and
Hebert, IJCV 2008). Surfaces lean back as furniture does on average: seats and tables are seen from above.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy import ndimage
from scipy.cluster.vq import kmeans2, vq

from ...core.cameras import Camera
from ..room.superpixels import superpixels
from .box_evidence import JITTER, appearance
from .room_box import FLOOR, RoomBox
from .segments import UPRIGHT, Segments, directions

_COLOURS = 48
_PIXELS = 4000  # of a capture, that the colours are made of
_ROUNDS = 3
_PATCH_PX = 7
_COMPACTNESS = 0.08
_HIGH_M = 1.1  # on a wall, over most furniture
_CLOSE_M = 2.0  # on the floor, before most furniture
_STRANGE = 1.5  # how much commoner furniture is than its colours
_LEAST_LOG_ODDS = 1.0
_LEAST_SHARE = 0.002  # of the picture, that a piece covers
_LEAST_OVER = 0.03  # of its pixels, over the line where the floor ends
_LEAST_UPRIGHT = 0.25  # of its height in the picture, that has upright edges
_LEAN = 0.2  # metres back a metre up
_NEARER = 0.85  # than the lowest that is seen, what goes on below the picture
_DEEPEST_M = 0.7
_HIGHEST_M = 2.2
_STRAIGHT = 1e-6  # level part of a unit direction, below which it is upright


@dataclass(frozen=True)
class Standing:
    """``depth`` (H, W) float64 planar metres of what stands on the floor, 0 elsewhere; ``odds`` (H, W) the log of how
    much likelier each pixel's colour is that of furniture than of the side of the box there; ``cut`` (H, W) bool,
    where its foot is below the picture."""

    depth: np.ndarray
    odds: np.ndarray
    cut: np.ndarray


def find_standing(
    images: Sequence[np.ndarray], cameras: Sequence[Camera], segments: Segments, box: RoomBox, seed: int = 0
) -> list[Standing]:
    """For pictures (H, W, 3) float32 in [0, 1] of ``cameras`` in a room, with their ``segments``."""
    odds = _odds(images, cameras, box, seed)
    uprights = directions(segments, box.turn) == UPRIGHT
    return [
        _standing(camera, box, one, segments.ends[uprights & (segments.view == index)])
        for index, (camera, one) in enumerate(zip(cameras, odds, strict=True))
    ]


def _odds(images: Sequence[np.ndarray], cameras: Sequence[Camera], box: RoomBox, seed: int) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    looks = [_look(image) for image in images]
    flat = [look.reshape(-1, look.shape[2]) for look in looks]
    pool = np.concatenate([look[rng.integers(len(look), size=_PIXELS)] for look in flat])
    pool = pool + rng.normal(0.0, JITTER, pool.shape)
    centres, _ = kmeans2(pool, _COLOURS, minit="++", iter=12, rng=seed)
    colours = [vq(one, centres)[0].reshape(look.shape[:2]) for one, look in zip(flat, looks, strict=True)]
    patches = [superpixels(appearance(image), _PATCH_PX, _COMPACTNESS) for image in images]
    sides, sure = [], []
    for camera in cameras:
        depth, side = box.hit(camera)
        points = camera.unproject(depth)
        away = np.linalg.norm((points - camera.centre)[..., :2], axis=-1)
        sides.append(side)
        sure.append(np.where(side == FLOOR, away < _CLOSE_M, points[..., 2] > _HIGH_M))
    background = [one.astype(np.float64) for one in sure]
    odds: list[np.ndarray] = []
    for _ in range(_ROUNDS):
        each_counts = np.zeros((len(colours), 7, _COLOURS))
        for here, colour, side, weight in zip(each_counts, colours, sides, background, strict=True):
            np.add.at(here, (side, colour), weight)
            np.add.at(here[6], colour, 1.0 - weight)
        counts = each_counts.sum(0)
        usual = counts.sum(0) / counts.sum()
        # The floor is what many captures have below: a table is before a few.
        floors = each_counts[:, FLOOR] / np.maximum(each_counts[:, FLOOR].sum(1, keepdims=True), 1.0)
        common = 0.3 * floors.mean(0) + 0.7 * np.median(floors, 0)
        counts[FLOOR] *= common / np.maximum(floors.mean(0), 1e-9) / max(float(common.sum()), 1e-9)
        share = (counts + 30.0 * usual) / (counts.sum(1, keepdims=True) + 30.0)
        strange = 0.5 * share[6] + 0.5 / _COLOURS
        odds = []
        for colour, side, patch in zip(colours, sides, patches, strict=True):
            each = np.log(_STRANGE * strange[colour] / share[side, colour])
            mean = np.bincount(patch.ravel(), each.ravel()) / np.maximum(np.bincount(patch.ravel()), 1)
            odds.append(cv2.GaussianBlur(0.3 * each + 0.7 * mean[patch], (0, 0), 1.0))
        background = [1.0 / (1.0 + np.exp(np.clip(one, -20, 20))) for one in odds]
    return odds


def _look(image: np.ndarray) -> np.ndarray:
    """(H, W, 4) float32: colour, and how rough it is."""
    look = appearance(image)
    mean, square = cv2.boxFilter(look[..., 0], -1, (5, 5)), cv2.sqrBoxFilter(look[..., 0], -1, (5, 5))
    return np.dstack([look, 1.5 * np.sqrt(np.maximum(square - mean * mean, 0.0))])


def upright(camera: Camera) -> tuple[Camera, np.ndarray]:
    """A level camera at the same place that sees the same, and (3, 3) from the pixels of ``camera`` to its.

    Of one that looks straight down or up it looks to where the picture's upper edge, or its lower one, is.
    """
    forward = camera.forward * [1.0, 1.0, 0.0]
    if np.linalg.norm(forward) < _STRAIGHT:
        forward = camera.world_from_camera[:3, 1] * [1.0, 1.0, 0.0] * np.sign(camera.forward[2])
    forward /= np.linalg.norm(forward)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = np.cross(forward, [0.0, 0.0, 1.0]), [0.0, 0.0, -1.0], forward
    pose[:3, 3] = camera.centre
    turned = pose[:3, :3].T @ camera.world_from_camera[:3, :3]
    corners = np.array([[u, v, 1.0] for u in (0, camera.width) for v in (0, camera.height)])
    rays = corners @ np.linalg.inv(camera.matrix).T @ turned.T
    ends = rays[:, :2] / np.maximum(rays[:, 2:], 0.25) * [camera.fx, camera.fy]
    low, high = np.floor(ends.min(0)), np.ceil(ends.max(0))
    size = np.clip(high - low, 1, 3 * max(camera.shape)).astype(int)
    level = Camera(int(size[0]), int(size[1]), camera.fx, camera.fy, -low[0], -low[1], pose)
    return level, level.matrix @ turned @ np.linalg.inv(camera.matrix)


def _standing(camera: Camera, box: RoomBox, odds: np.ndarray, uprights: np.ndarray) -> Standing:
    level, onto = upright(camera)
    size = (level.width, level.height)
    shift = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])  # OpenCV counts from pixels' middles
    warp = np.linalg.inv(shift) @ onto @ shift
    seen = cv2.warpPerspective(np.ones(camera.shape, np.uint8), warp, size, flags=cv2.INTER_NEAREST) > 0
    likely = cv2.warpPerspective(odds.astype(np.float32), warp, size, flags=cv2.INTER_LINEAR)
    wall, side = box.hit(level)
    below = (np.arange(level.height) + 0.5 - level.cy) / level.fy  # metres down a metre ahead
    height = level.centre[2]
    with np.errstate(divide="ignore"):
        ground = np.where(below > 0.0, height / np.maximum(below, 1e-9), np.inf)  # planar depth of the floor a row
    drawn = np.zeros((level.height, level.width), np.uint8)
    for ends in uprights:
        pixels, ahead = level.project(level.centre + ends)
        if (ahead > 0.1).all():
            begin, end = np.round(pixels - 0.5).astype(int).tolist()
            cv2.line(drawn, begin, end, (1,), 2)
    lines = drawn > 0
    found = seen & (likely > _LEAST_LOG_ODDS)
    found = ndimage.binary_opening(found, iterations=1)
    pieces, _ = ndimage.label(found)
    depth, cut = np.zeros(level.shape), np.zeros(level.shape, np.bool_)
    least = _LEAST_SHARE * camera.width * camera.height
    for index, where in enumerate(ndimage.find_objects(pieces), start=1):
        piece = pieces[where] == index
        if piece.sum() < least or not (piece & (side[where] == FLOOR)).any():
            continue
        rows, columns = where
        foot = rows.stop - 1 - piece[::-1].argmax(0)
        any_column = piece.any(0)
        on_floor = side[foot, columns.start + np.arange(len(foot))] == FLOOR
        contact = any_column & on_floor
        if not contact.any():
            continue
        below_seen = np.zeros(len(foot), np.bool_)
        ends = np.minimum(foot + 2, level.height - 1)
        below_seen = seen[ends, columns.start + np.arange(len(foot))] & (foot < level.height - 2)
        own = np.where(contact, ground[foot], np.inf)
        near = _front(own)
        near = np.where(contact & (own - near > _DEEPEST_M), own, near)
        near = np.where(any_column, np.where(below_seen, near, _NEARER * near), 0.0)
        # A carpet never rises over the line where the floor ends, and is not upright anywhere.
        over = (piece & (side[where] != FLOOR)).sum() / piece.sum()
        edges = (lines[where] & ndimage.binary_dilation(piece, iterations=2)).any(1).sum()
        if over < _LEAST_OVER and edges < _LEAST_UPRIGHT * len(piece):
            continue
        ahead = (near[None] + _LEAN * height) / (1.0 + _LEAN * below[rows][:, None])
        ahead = np.minimum(np.maximum(ahead, near[None]), near[None] + _DEEPEST_M)
        tall = height - below[rows][:, None] * near[None]
        ahead = np.where(piece & (tall < _HIGHEST_M), np.minimum(ahead, wall[where]), 0.0)
        depth[where] = np.where(piece, ahead, depth[where])
        cut[where] |= piece & ~below_seen[None]
    back, cut_back = (
        cv2.warpPerspective(one.astype(np.float32), np.linalg.inv(warp), camera.shape[::-1], flags=cv2.INTER_NEAREST)
        for one in (depth, cut)
    )
    facing = camera.rays() @ camera.world_from_camera[:3, :3].T @ level.forward
    return Standing(np.where(back > 0.0, back / np.maximum(facing, 1e-3), 0.0), odds, cut_back > 0)


def _front(near: np.ndarray) -> np.ndarray:
    """(n,) the nearest line over contacts (n,) of columns, inf where there is none: inverse depth is level along lines
    of the floor, so that its upper hull is the front of what stands on them."""
    at = np.flatnonzero(np.isfinite(near))
    inverse = 1.0 / near[at]
    hull: list[int] = []
    for k in range(len(at)):
        while len(hull) > 1:
            a, b = hull[-2], hull[-1]
            if (inverse[b] - inverse[a]) * (at[k] - at[a]) > (inverse[k] - inverse[a]) * (at[b] - at[a]):
                break
            hull.pop()
        hull.append(k)
    return np.asarray(1.0 / np.interp(np.arange(len(near)), at[hull], inverse[hull]))
