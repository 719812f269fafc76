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
from .segments import Segments, directions, room_axes, samples

TEMPERATURE = 8.0
"""By how much worse a score is that is e times less likely, as made-up rooms tell."""

_COLOURS = 24
_PIXELS = 2400  # of a capture, that are asked for their colours
_USUAL_HEIGHT_M, _HEIGHT_SPREAD_M = 2.5, 0.25
_COLOUR_WEIGHT, _EDGE_WEIGHT, _SIDE_WEIGHT = 400.0, 3.0, 1.0
_BORDER_WEIGHT, _ALIKE_WEIGHT, _KNOWN_WEIGHT = 0.1, 0.05, 0.3
_SKIRTING_COST = 3.0
_EDGE_RAD = 0.008
_ALIKE_STEP, _ALIKE_STEPS = 0.02, 40


@dataclass(frozen=True)
class BoxEvidence:
    """What hypotheses are scored by, in the room's axes: rays of pixels with their colours, of segments' samples with
    their directions and weights, each with its camera's centre."""

    pixel_rays: np.ndarray
    pixel_views: np.ndarray
    row_of: np.ndarray
    colours: np.ndarray
    known: np.ndarray
    line_rays: np.ndarray
    line_views: np.ndarray
    line_directions: np.ndarray
    line_weights: np.ndarray
    centres: np.ndarray
    projections: np.ndarray
    looks: np.ndarray
    own: np.ndarray
    alike: np.ndarray
    finer: float

    def scores(self, boxes: np.ndarray) -> np.ndarray:
        """(n,) of boxes (n, 6): x low, x high, y low, y high, height, height of the skirting board."""
        counts = np.zeros((len(boxes), 6, _COLOURS))
        terms = np.zeros((len(boxes), 4))
        _score(
            np.ascontiguousarray(boxes, np.float64),
            self.pixel_rays,
            self.pixel_views,
            self.row_of,
            self.colours,
            self.known,
            self.line_rays,
            self.line_views,
            self.line_directions,
            self.line_weights,
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
        told = (share * np.log(np.maximum(share, 1e-12) / np.maximum(apart, 1e-12))).sum((1, 2))
        usual = 0.5 * ((boxes[:, 4] - _USUAL_HEIGHT_M) / _HEIGHT_SPREAD_M) ** 2
        return (
            _COLOUR_WEIGHT * told
            + terms[:, 0]
            - _BORDER_WEIGHT * terms[:, 1] * np.sqrt(self.finer)
            + _ALIKE_WEIGHT * terms[:, 2] * self.finer
            + _KNOWN_WEIGHT * terms[:, 3] * self.finer
            - TEMPERATURE * usual
            - _SKIRTING_COST * (boxes[:, 5] > 0)
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
    weight = finer / max(1, len(cameras)) * np.ones(len(owner))
    all_looks = np.array(looks)
    return BoxEvidence(
        np.concatenate(rays),
        np.concatenate(views),
        np.concatenate(rows),
        clusters.astype(np.int64),
        np.concatenate(distances),
        np.ascontiguousarray(line_rays @ axes.T),
        segments.view[owner],
        kind[owner],
        weight,
        centre,
        np.array(projections),
        all_looks,
        np.concatenate(colours),
        _alike(np.concatenate(colours), seed),
        finer,
    )


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
def _score(
    boxes,
    rays,
    views,
    row_of,
    colours,
    known,
    line_rays,
    line_views,
    kinds,
    weights,
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
        labels = np.empty(rays.shape[0], np.int8)
        border, likeness, agree = 0.0, 0.0, 0.0
        for i in range(rays.shape[0]):
            o, d = centres[views[i]], rays[i]
            side, t = _side(box, o, d)
            labels[i] = side
            counts[b, side, colours[i]] += 1.0
            row = row_of[i]
            if row > 0:
                border += labels[i - row] != side
                border += views[i - 1] == views[i] and labels[i - 1] != side
            if known[i] > 0.0:
                if t < known[i] * 0.95:
                    agree -= 2.0
                elif t < known[i] * 1.05:
                    agree += 1.0
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
                    k = min(int(np.sqrt(off) / _ALIKE_STEP), _ALIKE_STEPS - 1)
                    best = max(best, alike[k])
                    seen = True
                if seen:
                    likeness += best
        lines = 0.0
        h, skirting = box[4], box[5]
        for i in range(line_rays.shape[0]):
            kind = kinds[i]
            if kind == 3:
                continue
            o, d = centres[line_views[i]], line_rays[i]
            side, t = _side(box, o, d)
            value = 0.0
            if kind == 2:
                if side == 5:
                    value -= _SIDE_WEIGHT
                elif side < 4:
                    for cx in range(2):
                        for cy in range(2):
                            value += _EDGE_WEIGHT * _coincides(box[cx] - o[0], box[2 + cy] - o[1], d[0], d[1])
            else:
                a = 1 - kind
                w = side // 2
                if w == kind:
                    value -= _SIDE_WEIGHT
                else:
                    if w == a:
                        value += _SIDE_WEIGHT
                    for c in range(2):
                        ua = box[2 * a + c] - o[a]
                        value += _EDGE_WEIGHT * _coincides(ua, -o[2], d[a], d[2])
                        value += _EDGE_WEIGHT * _coincides(ua, h - o[2], d[a], d[2])
                        if skirting > 0.0:
                            value += _EDGE_WEIGHT * _coincides(ua, skirting - o[2], d[a], d[2])
            lines += weights[i] * value
        terms[b, 0], terms[b, 1], terms[b, 2], terms[b, 3] = lines, border, likeness, agree
