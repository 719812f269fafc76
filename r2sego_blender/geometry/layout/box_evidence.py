"""How well boxes explain the captures: what a hypothesis of the room is scored by.

How much its six sides tell of the colours seen (mutual information of side and colour), line segments that lie on a
side they can lie on (orientation; Lee, Hebert and Kanade, CVPR 2009) and those that coincide with its edges (Hedau,
Hoiem and Forsyth, ICCV 2009), how alike captures are where they show the same place of it, and known depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.cluster.vq import kmeans2

from ...core.cameras import Camera
from ...core.compiled import inlined, parallel_kernel, prange
from .segments import ASTRAY, UPRIGHT, Segments, directions, room_axes, samples

_COLOURS = 40
_PIXELS = 2400  # of a capture, that are asked for their colours
_USUAL_HEIGHT_M, _HEIGHT_SPREAD_M = 2.5, 0.25
_EDGE_RAD = 0.008
_BINS = 200  # of an edge's length, each of which is seen once
_CLOSE_M = 2.0  # nearer to the camera most of what is low in the picture is floor
_WEIGHTS = np.array(
    [49.0, -0.0, 51.0, -40.0, 20.0, 0.0, 1.7, -1.4, -85.0, 0.0, 14.0, 54.0, 100.0, -15.0, -54.0, -0.0, -2.6, -3.7, 0.0]
)
_ALIKE_STEP, _ALIKE_STEPS = 0.02, 40


@dataclass(frozen=True)
class BoxEvidence:
    """What hypotheses are scored by, in the room's axes: rays of pixels with their colours, of segments' samples with
    their directions and weights, each with its camera's centre."""

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
    projections: np.ndarray
    looks: np.ndarray
    own: np.ndarray
    alike: np.ndarray
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
            self.projections,
            self.looks,
            self.own,
            self.alike,
            counts,
            terms,
        )
        share = counts / counts.sum((1, 2), keepdims=True)
        apart = share.sum(2, keepdims=True) * share.sum(1, keepdims=True)
        terms[:, 0] = (share * np.log(np.maximum(share, 1e-12) / np.maximum(apart, 1e-12))).sum((1, 2))
        terms[:, 1:6] /= len(self.own)
        terms[:, 6:13] /= len(self.centres) * 100.0 / self.finer
        terms[:, 13:16] /= np.sqrt(len(self.own)) * len(self.centres)
        terms[:, 16] = 0.5 * ((boxes[:, 4] - _USUAL_HEIGHT_M) / _HEIGHT_SPREAD_M) ** 2
        terms[:, 17] = np.log(boxes[:, 1] - boxes[:, 0]) + np.log(boxes[:, 3] - boxes[:, 2])
        terms[:, 18] = boxes[:, 5] > 0.0
        return terms

    def scores(self, boxes: np.ndarray) -> np.ndarray:
        """(n,) log likelihood up to a constant of ``boxes``, as of ``terms``."""
        return self.terms(boxes) @ _WEIGHTS


def box_evidence(
    images: Sequence[np.ndarray],
    cameras: Sequence[Camera],
    known: Sequence[np.ndarray],
    segments: Segments,
    turn: float,
    seed: int,
    finer: float,
) -> BoxEvidence:
    axes = room_axes(turn)
    rays, views, rows, colours, distances, looks, projections = [], [], [], [], [], [], []
    for index, (image, camera, depth) in enumerate(zip(images, cameras, known, strict=True)):
        step = max(1, int(np.sqrt(image.shape[0] * image.shape[1] * finer / _PIXELS)))
        at = slice(step // 2, None, step)
        local = (camera.rays() @ (axes @ camera.world_from_camera[:3, :3]).T)[at, at]
        row = len(local[0])
        local = local.reshape(-1, 3)
        length = np.linalg.norm(local, axis=1)
        rays.append(local / length[:, None])
        distances.append(depth[at, at].ravel() * length)
        views.append(np.full(len(local), index))
        rows.append(np.where(np.arange(len(local)) >= row, row, 0))
        look = appearance(image)
        colours.append(look[at, at].reshape(len(local), -1))
        looks.append(look[at, at])
        small = Camera(
            look[at, at].shape[1],
            look[at, at].shape[0],
            camera.fx / step,
            camera.fy / step,
            (camera.cx - step // 2 - 0.5) / step + 0.5,
            (camera.cy - step // 2 - 0.5) / step + 0.5,
            camera.world_from_camera,
        )
        turned = np.eye(4)
        turned[:3, :3] = axes.T
        projections.append(small.matrix @ (small.camera_from_world @ turned)[:3])
    _, clusters = kmeans2(np.concatenate(colours), _COLOURS, minit="++", iter=12, rng=seed)
    line_rays, owner = samples(segments, max(cameras[0].shape) / finer)
    kind = directions(segments, turn)
    centre = np.array([camera.centre for camera in cameras]) @ axes.T
    all_looks = np.array(looks)
    floor_like = _floor_like(clusters, np.concatenate(rays), centre[np.concatenate(views), 2])
    likely = floor_like[clusters].reshape(len(cameras), *looks[0].shape[:2])
    lines = line_rays @ axes.T
    feet = _feet(lines, segments.view[owner], np.array(projections), likely)
    return BoxEvidence(
        np.concatenate(rays),
        np.concatenate(views),
        np.concatenate(rows),
        clusters.astype(np.int64),
        floor_like,
        np.concatenate(distances),
        np.ascontiguousarray(lines),
        segments.view[owner],
        kind[owner],
        feet,
        centre,
        np.array(projections),
        all_looks,
        np.concatenate(colours),
        _alike(np.concatenate(colours), seed),
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


def _feet(rays: np.ndarray, views: np.ndarray, projections: np.ndarray, likely: np.ndarray) -> np.ndarray:
    """(m,) in [0, 1]: how much the picture looks like floor below points of segments and unlike it above, ``likely``
    (N, H, W) being the log of how much each pixel does."""
    height, width = likely.shape[1:]
    pixels = np.einsum("mij,mj->mi", projections[views][:, :, :3], rays)
    pixels = pixels[:, :2] / np.maximum(pixels[:, 2:], 1e-6)
    column = np.clip(pixels[:, 0].astype(int), 0, width - 1)
    below, above = (
        np.mean(
            [likely[views, np.clip((pixels[:, 1] + sign * k).astype(int), 0, height - 1), column] for k in (1, 2)], 0
        )
        for sign in (1.0, -1.0)
    )
    level: np.ndarray = (
        1.0
        / (1.0 + np.exp(-2.0 * np.clip(below, -2.0, 2.0)))
        / (1.0 + np.exp(-2.0 * np.clip(below - above - 0.3, -3.0, 3.0)))
    )
    return level


def _alike(colours: np.ndarray, seed: int) -> np.ndarray:
    """(steps,) what a difference of appearance says for one surface against two by chance: the log of their ratio."""
    rng = np.random.default_rng(seed)
    one, other = rng.integers(len(colours), size=(2, 20000))
    off = np.linalg.norm(colours[one] - colours[other], axis=1)
    chance = np.bincount(np.minimum((off / _ALIKE_STEP).astype(int), _ALIKE_STEPS - 1), minlength=_ALIKE_STEPS) + 5.0
    chance = chance / chance.sum()
    middle = (np.arange(_ALIKE_STEPS) + 0.5) * _ALIKE_STEP
    same = middle * np.exp(-middle / 0.04)
    same = 0.7 * same / same.sum() + 0.3 * chance
    return np.log(same / chance)


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
    boxes,
    rays,
    views,
    row_of,
    colours,
    floor_like,
    known,
    line_rays,
    line_views,
    kinds,
    feet,
    centres,
    projections,
    looks,
    own,
    alike,
    counts,
    terms,
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
            if side == 4:
                term[2] += min(floor_like[colours[i]], 0.0)
            elif d[2] < 0.0:
                term[1] += max(floor_like[colours[i]], 0.0)
            row = row_of[i]
            if row > 0:
                for j in (i - row, i - 1):
                    if views[j] == views[i] and labels[j] != side:
                        farther = max(labels[j], side)
                        term[13 if farther == 4 else 14 if farther == 5 else 15] += 1.0
            if known[i] > 0.0:
                if t < known[i] * 0.95:
                    term[3] += 1.0
                elif t < known[i] * 1.05:
                    term[4] += 1.0
            if i % 2 == 0:
                best, seen = -10.0, False
                x, y, z = o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]
                for v in range(centres.shape[0]):
                    if v == views[i]:
                        continue
                    p = projections[v]
                    w = p[2, 0] * x + p[2, 1] * y + p[2, 2] * z + p[2, 3]
                    if w < 0.2:
                        continue
                    u = (p[0, 0] * x + p[0, 1] * y + p[0, 2] * z + p[0, 3]) / w
                    q = (p[1, 0] * x + p[1, 1] * y + p[1, 2] * z + p[1, 3]) / w
                    if not (0.0 <= u < looks.shape[2] and 0.0 <= q < looks.shape[1]):
                        continue
                    off = 0.0
                    for c in range(3):
                        off += (looks[v, int(q), int(u), c] - own[i, c]) ** 2
                    best = max(best, alike[min(int(np.sqrt(off) / _ALIKE_STEP), _ALIKE_STEPS - 1)])
                    seen = True
                if seen:
                    term[5] += best
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
                term[6 if wall < 2 else 7 if side == 4 else 8] += 1.0
                if wall < 2:
                    bin = int((d[2] + 1.0) * 0.499 * _BINS)
                    for cx in range(2):
                        for cy in range(2):
                            found = _coincides(box[cx] - o[0], box[2 + cy] - o[1], d[0], d[1])
                            on[2 * cx + cy, bin] = max(on[2 * cx + cy, bin], found)
            else:
                across = 1 - kind
                if wall == kind:
                    term[8] += 1.0
                else:
                    if wall == across:
                        term[9] += 1.0
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
                k = 10 if edge < 4 else 11 if (edge - 4) % 3 != 1 else 12
                for bin in range(_BINS):
                    found = covered[v, edge, bin]
                    if edge >= 4 and (edge - 4) % 3 == 2:  # a skirting board is over its foot
                        found = min(found, covered[v, edge - 2, bin])
                    term[k] += found
        for k in range(terms.shape[1]):
            terms[b, k] = term[k]
