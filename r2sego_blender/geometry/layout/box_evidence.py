"""How well boxes explain the captures: what a hypothesis of the room is scored by.

How much its six sides tell of the colours seen (mutual information of side and colour), line segments that lie on a
side they can lie on (orientation; Lee, Hebert and Kanade, CVPR 2009) and those that coincide with its edges (Hedau,
Hoiem and Forsyth, ICCV 2009; a wall's foot has floor below), and known depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from scipy.cluster.vq import kmeans2

from ...core.cameras import Camera
from ...core.compiled import inlined, parallel_kernel, prange
from .room_box import FLOOR
from .segments import ASTRAY, UPRIGHT, Segments, directions, room_axes, samples

JITTER = 1e-3
"""Of colours before they are clustered: a picture may have fewer colours than there are clusters."""

_COLOURS = 40
_PIXELS = 2400  # of a capture, that are asked for their colours
_USUAL_HEIGHT_M, _HEIGHT_SPREAD_M = 2.5, 0.25
_EDGE_RAD = 0.008
_BINS = 200  # of an edge's length, each of which is seen once
_CLOSE_M = 2.0  # nearer to the camera most of what is low in the picture is floor
# Fitted so that the true boxes of made-up rooms (tests/rooms/furnished_rooms.py) and of the development rooms
# (tools/rooms) are likelier than others, by descent on the expected error; ``_terms`` says of what.
_WEIGHTS = np.array(
    [
        49.0,  # colours: nats that the side tells of a pixel's colour
        51.0,  # unlike: of the colours on the floor, negative logs of how much they look like floor
        -40.0,  # before: share of the pixels whose known depth is behind the box
        20.0,  # known: share of the pixels whose known depth is the box's
        1.7,  # upright segments on walls
        -1.4,  # upright segments on the floor
        -85.0,  # segments on a side that they cannot lie on
        14.0,  # corners of walls that segments cover
        54.0,  # feet of walls, and skirting boards, that segments cover
        100.0,  # edges of the ceiling that segments cover
        -15.0,  # length of the feet seen
        -54.0,  # length of the ceiling's edges seen
        -2.6,  # half the square of how unusual the height is
        -3.7,  # log of the area
    ]
)
_COLOUR, _UNLIKE, _BEFORE, _KNOWN, _ON_WALL, _ON_FLOOR, _WRONG = range(7)
_CORNERS, _FEET, _CEILING, _FEET_SEEN, _CEILING_SEEN, _HEIGHT, _AREA = range(7, 14)


@dataclass(frozen=True)
class BoxEvidence:
    """What hypotheses are scored by, in the room's axes.

    Of n pixels their unit rays (n, 3), captures, the number of pixels in the row above (0 in the first), clusters of
    colour, and known distance along the ray, 0 unknown; ``floor_like`` of each cluster the log of how much it looks
    like floor. Of m samples of segments rays, captures, directions, and how much each looks like a foot. ``centres``
    (N, 3); ``finer``, how many times fewer pixels and samples than usual are asked.
    """

    pixel_rays: np.ndarray
    pixel_views: np.ndarray
    row_of: np.ndarray
    colours: np.ndarray
    floor_like: np.ndarray
    known: np.ndarray
    line_rays: np.ndarray
    line_views: np.ndarray
    line_directions: np.ndarray
    line_feet: np.ndarray
    centres: np.ndarray
    finer: float

    def terms(self, boxes: np.ndarray) -> np.ndarray:
        """(n, len(_WEIGHTS)) what speaks for boxes (n, 6): x low, x high, y low, y high, height, skirting board's."""
        counts = np.zeros((len(boxes), 6, _COLOURS))
        terms = np.zeros((len(boxes), len(_WEIGHTS)))
        _terms(
            np.ascontiguousarray(boxes, np.float64),
            self.pixel_rays,
            self.pixel_views,
            self.row_of,
            self.colours,
            self.floor_like,
            self.known,
            self.line_rays,
            self.line_views,
            self.line_directions,
            self.line_feet,
            self.centres,
            counts,
            terms,
        )
        share = counts / counts.sum((1, 2), keepdims=True)
        apart = share.sum(2, keepdims=True) * share.sum(1, keepdims=True)
        terms[:, _COLOUR] = (share * np.log(np.maximum(share, 1e-12) / np.maximum(apart, 1e-12))).sum((1, 2))
        terms[:, _UNLIKE : _KNOWN + 1] /= len(self.colours)
        terms[:, _ON_WALL : _CEILING + 1] /= len(self.centres) * 100.0 / self.finer
        terms[:, _FEET_SEEN : _CEILING_SEEN + 1] /= np.sqrt(len(self.colours)) * len(self.centres)
        terms[:, _HEIGHT] = 0.5 * ((boxes[:, 4] - _USUAL_HEIGHT_M) / _HEIGHT_SPREAD_M) ** 2
        terms[:, _AREA] = np.log(boxes[:, 1] - boxes[:, 0]) + np.log(boxes[:, 3] - boxes[:, 2])
        return terms

    def scores(self, boxes: np.ndarray) -> np.ndarray:
        """(n,) log likelihood up to a constant of ``boxes``, as of ``terms``."""
        return self.terms(boxes) @ _WEIGHTS


class _Pixels(NamedTuple):
    """Every so many-th pixel of a capture: ``rays`` (n, 3) in the room's axes, of length one; known ``distances`` (n,)
    along them; ``row`` (n,), how far back the pixel above is; ``look`` (h, w, 3) their colours; ``projection`` (3, 4)
    from the room's axes onto them.
    """

    rays: np.ndarray
    distances: np.ndarray
    row: np.ndarray
    look: np.ndarray
    projection: np.ndarray

    @staticmethod
    def of(image: np.ndarray, camera: Camera, depth: np.ndarray, axes: np.ndarray, finer: float) -> _Pixels:
        step = max(1, int(np.sqrt(image.shape[0] * image.shape[1] * finer / _PIXELS)))
        at = slice(step // 2, None, step)
        rays = (camera.rays() @ (axes @ camera.world_from_camera[:3, :3]).T)[at, at]
        row = len(rays[0])
        rays = rays.reshape(-1, 3)
        length = np.linalg.norm(rays, axis=1)
        look = appearance(image)[at, at]
        small = Camera(
            look.shape[1],
            look.shape[0],
            camera.fx / step,
            camera.fy / step,
            (camera.cx - step // 2 - 0.5) / step + 0.5,
            (camera.cy - step // 2 - 0.5) / step + 0.5,
            camera.world_from_camera,
        )
        world_from_room = np.eye(4)
        world_from_room[:3, :3] = axes.T
        return _Pixels(
            rays / length[:, None],
            depth[at, at].ravel() * length,
            np.where(np.arange(len(rays)) >= row, row, 0),
            look,
            small.matrix @ (small.camera_from_world @ world_from_room)[:3],
        )


def box_evidence(
    images: Sequence[np.ndarray],
    cameras: Sequence[Camera],
    known: Sequence[np.ndarray],
    segments: Segments,
    turn: float,
    seed: int,
    finer: float,
) -> BoxEvidence:
    """The evidence of pictures (H, W, 3) float32 in [0, 1] for boxes of a room whose axes are turned by ``turn``, rad.

    ``known`` (H, W) is planar depth, metres, 0 where it is unknown; ``segments`` are the
    pictures'. ``finer`` as in ``BoxEvidence``; colours are clustered by ``seed``.
    """
    axes = room_axes(turn)
    pixels = [_Pixels.of(*capture, axes, finer) for capture in zip(images, cameras, known, strict=True)]
    sizes = [len(one.rays) for one in pixels]
    rays, views = np.concatenate([one.rays for one in pixels]), np.repeat(np.arange(len(pixels)), sizes)
    colours = np.concatenate([one.look.reshape(size, -1) for one, size in zip(pixels, sizes, strict=True)])
    jittered = colours + np.random.default_rng(seed).normal(0.0, JITTER, colours.shape)
    _, clusters = kmeans2(jittered, _COLOURS, minit="++", iter=12, rng=seed)
    line_rays, owner = samples(segments, max(cameras[0].shape) / finer)
    kind = directions(segments, turn)
    centre = np.array([camera.centre for camera in cameras]) @ axes.T
    floor_like = _floor_like(clusters, rays, centre[views, 2])
    lines, feet = line_rays @ axes.T, np.zeros(len(owner))
    for index, one in enumerate(pixels):
        likely = floor_like[clusters[views == index]].reshape(one.look.shape[:2])
        of = segments.view[owner] == index
        feet[of] = _feet(lines[of], one.projection, likely)
    return BoxEvidence(
        rays,
        views,
        np.concatenate([one.row for one in pixels]),
        clusters.astype(np.int64),
        floor_like,
        np.concatenate([one.distances for one in pixels]),
        np.ascontiguousarray(lines),
        segments.view[owner],
        kind[owner],
        feet,
        centre,
        finer,
    )


def _floor_like(colours: np.ndarray, rays: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """(colours,) log of how much oftener each is low and close than above the horizon, where no floor is."""
    low = -heights / np.minimum(rays[:, 2], -1e-6) < _CLOSE_M * 1.3
    low &= rays[:, 2] < 0.0
    floor = np.bincount(colours[low], minlength=_COLOURS) + 1.0
    other = np.bincount(colours[rays[:, 2] > 0.0], minlength=_COLOURS) + 1.0
    ratio: np.ndarray = np.clip(np.log(floor / floor.sum() / (other / other.sum())), -2.0, 2.0)
    return ratio


def _feet(rays: np.ndarray, projection: np.ndarray, likely: np.ndarray) -> np.ndarray:
    """(m,) in [0, 1]: how much a picture looks like floor below points of segments and unlike it above, ``likely``
    (H, W) being the log of how much each pixel does. ``projection`` (3, 4) is onto its pixels."""
    height, width = likely.shape
    pixels = rays @ projection[:, :3].T
    pixels = pixels[:, :2] / np.maximum(pixels[:, 2:], 1e-6)
    column, row = np.clip(pixels[:, 0].astype(int), 0, width - 1), pixels[:, 1]
    below, above = (
        np.mean([likely[np.clip((row + sign * k).astype(int), 0, height - 1), column] for k in (1, 2)], 0)
        for sign in (1.0, -1.0)
    )
    floor = 1.0 / (1.0 + np.exp(-2.0 * np.clip(below, -2.0, 2.0)))
    ends: np.ndarray = 1.0 / (1.0 + np.exp(-2.0 * np.clip(below - above - 0.3, -3.0, 3.0)))
    return floor * ends


def appearance(image: np.ndarray) -> np.ndarray:
    """(H, W, 3) float32 colours whose distances are those that people see: L*a*b* by 100."""
    blurred = cv2.GaussianBlur(image, (0, 0), 1.0)
    lab = cv2.cvtColor(blurred, cv2.COLOR_RGB2LAB) / np.float32(100.0)
    return lab * np.array([0.7, 1.0, 1.0], np.float32)


@inlined
def _side(box, o, d):
    best, side = 1e9, 4
    for k in range(3):
        if k < 2:
            lo, hi = box[2 * k], box[2 * k + 1]
        else:
            lo, hi = 0.0, box[4]
        if d[k] > 1e-9:
            t = (hi - o[k]) / d[k]
            if t < best:
                best, side = t, 2 * k + 1
        elif d[k] < -1e-9:
            t = (lo - o[k]) / d[k]
            if t < best:
                best, side = t, 2 * k
    return side, best


@inlined
def _coincides(ua, uz, da, dz):
    """How well a ray's direction is that to an edge, in a plane across it."""
    found = 0.0
    if ua * da + uz * dz > 0.0:
        norm = np.sqrt(ua * ua + uz * uz) * np.sqrt(da * da + dz * dz) + 1e-9
        off = (ua * dz - uz * da) / norm / _EDGE_RAD
        if abs(off) < 3.0:
            found = np.exp(-0.5 * off * off)
    return found


@parallel_kernel
def _terms(
    boxes, rays, views, row_of, colours, floor_like, known, line_rays, line_views, kinds, feet, centres, counts, terms
):
    for b in prange(boxes.shape[0]):
        box = boxes[b]
        term = np.zeros(terms.shape[1])
        labels = np.empty(rays.shape[0], np.int8)
        for i in range(rays.shape[0]):
            o, d = centres[views[i]], rays[i]
            side, t = _side(box, o, d)
            labels[i] = side
            counts[b, side, colours[i]] += 1.0
            if side == FLOOR:
                term[_UNLIKE] += min(floor_like[colours[i]], 0.0)
            row = row_of[i]
            if row > 0:
                for j in (i - row, i - 1):
                    if views[j] == views[i] and labels[j] != side:
                        farther = max(labels[j], side)
                        if farther >= FLOOR:
                            term[_FEET_SEEN if farther == FLOOR else _CEILING_SEEN] += 1.0
            if known[i] > 0.0:
                if t < known[i] * 0.95:
                    term[_BEFORE] += 1.0
                elif t < known[i] * 1.05:
                    term[_KNOWN] += 1.0
        h, skirting = box[4], box[5]
        covered = np.zeros((centres.shape[0], 16, _BINS), np.float32)
        for i in range(line_rays.shape[0]):
            kind = kinds[i]
            if kind == ASTRAY:
                continue
            o, d, on = centres[line_views[i]], line_rays[i], covered[line_views[i]]
            side, _ = _side(box, o, d)
            wall = side // 2
            if kind == UPRIGHT:
                term[_ON_WALL if wall < 2 else _ON_FLOOR if side == FLOOR else _WRONG] += 1.0
                if wall < 2:
                    bin = int((d[2] + 1.0) * 0.499 * _BINS)
                    for cx in range(2):
                        for cy in range(2):
                            found = _coincides(box[cx] - o[0], box[2 + cy] - o[1], d[0], d[1])
                            on[2 * cx + cy, bin] = max(on[2 * cx + cy, bin], found)
            else:
                across = 1 - kind
                if wall == kind:
                    term[_WRONG] += 1.0
                else:
                    bin = int((d[kind] + 1.0) * 0.499 * _BINS)
                    for c in range(2):
                        away, edge = box[2 * across + c] - o[across], 4 + 6 * across + 3 * c
                        for k in range(3):
                            z = 0.0 if k == 0 else h if k == 1 else skirting
                            if k < 2 or skirting > 0.0:
                                found = _coincides(away, z - o[2], d[across], d[2])
                                if k == 0:
                                    found *= feet[i]
                                on[edge + k, bin] = max(on[edge + k, bin], found)
        for v in range(centres.shape[0]):
            for edge in range(16):
                k = _CORNERS if edge < 4 else _CEILING if (edge - 4) % 3 == 1 else _FEET
                for bin in range(_BINS):
                    found = covered[v, edge, bin]
                    if edge >= 4 and (edge - 4) % 3 == 2:  # a skirting board is over its foot
                        found = min(found, covered[v, edge - 2, bin])
                    term[k] += found
        for k in range(terms.shape[1]):
            terms[b, k] = term[k]
