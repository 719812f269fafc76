"""Alignment of a shape with an object of the captures: the similarity T_m* = (s, R, t).

The energy of a pose asks the object's observed points how far they lie from the shape, every
capture's mask how well the shape's silhouette fills it, and the room whether the shape stays
inside. Points alone turn a chair round: silhouettes tell its sides apart. What a capture saw
behind the shape was free, so it counts against the silhouette; what it saw before the shape
may hide it, and does not. The search starts from all upright orientations and many headings,
and goes on with the best of them, from small images to the captures' own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from ...core.cameras import Camera, rotation_angle_rad
from ...core.errors import GeometryError
from ...core.images import resize_nearest
from ..room.planes import RoomPlanes
from .pose_search import OUTSIDE, POINTS, Problem, energies, energy_parts, refined, view_misfit
from .shapes import Shape
from .silhouettes import BOTH, DRAWN, FREE, SHAPE_ONLY, MaskViews, scratch

_MASK_PX = (500, 2000, 10_000)  # the largest mask at each scale of the search
_WINDOW_MARGINS = (1.0, 0.5, 0.25)  # of the mask's box, on each side
_LEAST_MASK_PX = 30  # at full size; a smaller mask says little
_POINTS = 1200
_FEW_POINTS = 300
_ENOUGH_POINTS = 100  # to tell where the object is
_POINT_REACH_M = 0.10  # points further from the shape than this are another surface's
_COARSE_REACHES = (0.10, 0.05)  # the same in shares of the object's size, where that is more
_FINE_REACH_M = 0.04
_HEADINGS = 24
_SIZES = (0.85, 1.0, 1.15)
_KEPT = (14, 7, 3)  # poses that go on to each scale
_SCREENED_HEADINGS, _SCREENED_SIZES, _SCREENED = 12, (0.9, 1.1), 4
_TURNED = (0, 5, 3)  # of them, those that are the best one turned over
_EVALUATIONS = (220, 220, 180)  # of each simplex search
_SEARCHES = (1, 2, 2)
_SETTLING = (1, 2)  # halvings of the first step in the last searches
_LEAST_RESIDUAL = 1e-3
_NEAR_TURN = np.radians(25.0)
_SAME_SURFACE = 0.012  # of the size: mean distance of the surfaces in poses that are one
_COMPARED = 150  # samples of each surface
_STEPS = np.array([0.12, 0.12, 0.12, 0.06, 0.05, 0.05, 0.05])  # rad, log scale, share of the size


@dataclass(frozen=True)
class ObjectEvidence:
    """What the captures know of one object.

    ``points`` (P, 3) float64 observed on it, world metres; ``guesses``: (centre (3,), length
    of its box's diagonal in metres) by the points and by the masks; ``views``: its masks at the
    scales of the search, coarsest first; ``mask_areas_px`` (V,) at full size; ``bounds``:
    the planes of the room that it stands within.
    """

    name: str
    points: np.ndarray
    guesses: tuple[tuple[np.ndarray, float], ...]
    views: tuple[MaskViews, ...]
    mask_areas_px: np.ndarray
    bounds: RoomPlanes

    @staticmethod
    def of(
        name: str,
        cameras: Sequence[Camera],
        masks: Sequence[np.ndarray],
        depths: Sequence[np.ndarray],
        points: np.ndarray,
        bounds: RoomPlanes,
    ) -> ObjectEvidence:
        """``masks`` (H, W) bool and ``depths`` (H, W) planar metres, 0 = unknown, one a camera.

        Raises GeometryError when no mask shows the object.
        """
        areas = np.array([int(mask.sum()) for mask in masks])
        if not (areas >= _LEAST_MASK_PX).any():
            raise GeometryError("no mask shows the object", where=name, cure="Draw it in two photographs at least.")
        scales = [min(1.0, float(np.sqrt(pixels / areas.max()))) for pixels in _MASK_PX]
        views = tuple(
            MaskViews.of(*_windows(cameras, masks, depths, scale, margin))
            for scale, margin in zip(scales, _WINDOW_MARGINS, strict=True)
        )
        points = np.asarray(points, np.float64).reshape(-1, 3)
        if len(points) > _POINTS:
            points = points[np.linspace(0, len(points) - 1, _POINTS).astype(int)]
        shown = [k for k, area in enumerate(areas) if area >= _LEAST_MASK_PX]
        whole = [k for k in shown if not _at_border(masks[k])]
        used = whole if len(whole) >= 2 else shown
        guesses = [_triangulated([cameras[k] for k in used], [masks[k] for k in used])]
        if len(points) >= _ENOUGH_POINTS:
            low, high = np.quantile(points, [0.02, 0.98], axis=0)
            guesses.append(((low + high) / 2, float(np.linalg.norm(high - low))))
        return ObjectEvidence(name, points, tuple(guesses), views, areas, bounds)


@dataclass(frozen=True)
class Alignment:
    """A shape placed in the world, and how well it fits.

    ``world_from_own`` (4, 4): the similarity of the mesh's own frame; ``energy``: the sum of
    ``point_residual`` (0 to 1, the mean distance of observed points, held at its reach),
    1 - ``silhouette_iou`` and ``outside``; ``free_space``: the share of the silhouette where
    captures saw free space. ``ious`` (V,) of each mask, NaN where it shows too little.
    """

    shape: str
    world_from_own: np.ndarray
    energy: float
    point_residual: float
    point_distance_m: float
    silhouette_iou: float
    free_space: float
    outside: float
    ious: np.ndarray

    @property
    def scale(self) -> float:
        """s of the similarity."""
        return float(np.cbrt(np.linalg.det(self.world_from_own[:3, :3])))


def screened(shapes: Sequence[Shape], evidence: ObjectEvidence, count: int) -> dict[str, float]:
    """Energies by the shapes' names in the smallest images: enough to tell them apart.

    Only the best ``count`` starts of all are searched from; the others' energies are their
    best start's.
    """
    starts = [
        _first(shape, evidence, _starts(shape, evidence, _SCREENED_HEADINGS, _SCREENED_SIZES), _SCREENED)
        for shape in shapes
    ]
    found = {
        shape.name: float(energies(_problem(shape, evidence, 0), some[:1])[0])
        for shape, some in zip(shapes, starts, strict=True)
    }
    order = sorted(range(len(shapes)), key=lambda k: found[shapes[k].name])
    for k in order[:count]:
        found[shapes[k].name] = float(_searched(shapes[k], evidence, 0, starts[k])[1][0])
    return found


def roughly_aligned(shape: Shape, evidence: ObjectEvidence) -> tuple[float, np.ndarray]:
    """The best energy in images of half the size, and poses (K, 12) worth going on with."""
    starts = _starts(shape, evidence, _HEADINGS, _SIZES)
    poses, _ = _searched(shape, evidence, 0, _first(shape, evidence, starts, _KEPT[0]))
    poses, found = _searched(shape, evidence, 1, _with_turned(shape, evidence, 1, poses))
    return float(found[0]), poses


def align(shape: Shape, evidence: ObjectEvidence, rough: np.ndarray | None = None) -> Alignment:
    """The best pose of ``shape`` found, from the poses of ``roughly_aligned``. Deterministic."""
    if rough is None:
        _, rough = roughly_aligned(shape, evidence)
    poses, _ = _searched(shape, evidence, 2, _with_turned(shape, evidence, 2, rough))
    return _settled(shape, evidence, poses[0])


def realigned(shape: Shape, evidence: ObjectEvidence, world_from_own: np.ndarray) -> Alignment:
    """The best pose near one set by hand; it is not turned over."""
    poses = _pose_of(shape, world_from_own)[None]
    for level in (1, 2):
        poses, _ = _searched(shape, evidence, level, poses)
    return _settled(shape, evidence, poses[0])


def _first(shape: Shape, evidence: ObjectEvidence, starts: np.ndarray, count: int) -> np.ndarray:
    """The best starts."""
    order = np.argsort(energies(_problem(shape, evidence, 0), starts), kind="stable")
    return _distinct(shape, starts[order], count)


def _with_turned(shape: Shape, evidence: ObjectEvidence, level: int, poses: np.ndarray) -> np.ndarray:
    """The poses that go on to a scale: the best one turned over, and the next best."""
    turned = _turned(shape, _problem(shape, evidence, level), poses[0], _TURNED[level])
    return np.concatenate([turned, poses[1 : _KEPT[level] - len(turned) + 1]])


def _settled(shape: Shape, evidence: ObjectEvidence, pose: np.ndarray) -> Alignment:
    """The pose where points and masks pull by how well each of them fits.

    How large the errors of either are nobody knows: stereo makes leaves thicker than they are,
    people draw outlines loosely. If they are Laplacian, the likeliest pose has the least product
    of the mean errors, so each term weighs by the inverse of what is left of it, and points
    never more than in the search. The energy told is the search's.
    """
    problem, poses = _problem(shape, evidence, 2), pose[None]
    for shrunk in _SETTLING:
        misfit, distance, _ = _parts(problem, poses[0])[0]
        weight = min(1.0, misfit / max(distance, _LEAST_RESIDUAL))
        poses, _ = refined(problem._replace(point_weight=float(weight)), poses, _steps(2, shrunk), _EVALUATIONS[2])
    return _alignment(shape, evidence, problem, poses[0])


def _searched(shape: Shape, evidence: ObjectEvidence, level: int, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The poses after searches, best first, and their energies."""
    poses, found = refined(_problem(shape, evidence, level), poses, _steps(level), _EVALUATIONS[level])
    order = np.argsort(found, kind="stable")
    return poses[order], found[order]


def _steps(level: int, shrunk: int = 0) -> np.ndarray:
    """(S, 7) the first steps of a scale's searches."""
    return np.stack([0.5 ** (max(0, level - 1) + search + shrunk) * _STEPS for search in range(_SEARCHES[level])])


def _parts(problem: Problem, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3,) the energy's parts, and (V, 3, 4) the pixels counted for them."""
    counts = np.empty((len(problem.shown), 3, 4), np.int64)
    local, buffer = scratch(problem.views.sizes, len(problem.vertices))
    return energy_parts(problem, pose, local, buffer, counts), counts


def rated(shape: Shape, evidence: ObjectEvidence, world_from_own: np.ndarray) -> Alignment:
    """A given pose, such as one set by hand, with its energy."""
    pose = _pose_of(shape, world_from_own)
    return _alignment(shape, evidence, _problem(shape, evidence, len(_MASK_PX) - 1), pose)


def _pose_of(shape: Shape, world_from_own: np.ndarray) -> np.ndarray:
    """The row of twelve that the search works on."""
    world_from_canonical = world_from_own @ np.linalg.inv(shape.canonical_from_own)
    return np.concatenate([world_from_canonical[:3, :3].ravel(), world_from_canonical[:3, 3]])


def _problem(shape: Shape, evidence: ObjectEvidence, level: int) -> Problem:
    views = evidence.views[level]
    size_m = max(length for _, length in evidence.guesses)
    if level == len(_MASK_PX) - 1:
        reach_m = _FINE_REACH_M
    else:
        reach_m = max(_POINT_REACH_M, _COARSE_REACHES[level] * size_m)
    shown = evidence.mask_areas_px >= _LEAST_MASK_PX
    points = evidence.points if level else evidence.points[:: 1 + len(evidence.points) // _FEW_POINTS]
    return Problem(
        views,
        shown,
        float((views.masks > DRAWN).sum() / shown.sum()),
        np.ascontiguousarray(points),
        reach_m,
        evidence.bounds.normals,
        evidence.bounds.offsets.astype(float),
        *shape.drawn[level],
        shape.surface,
    )


def _alignment(shape: Shape, evidence: ObjectEvidence, problem: Problem, pose: np.ndarray) -> Alignment:
    parts, counts = _parts(problem, pose)
    misfits = np.array([view_misfit(problem, counts, v) for v in range(len(counts))])
    world_from_canonical = np.eye(4)
    world_from_canonical[:3, :3], world_from_canonical[:3, 3] = pose[:9].reshape(3, 3), pose[9:]
    local = (evidence.points - pose[9:]) @ np.linalg.inv(pose[:9].reshape(3, 3)).T
    distances = np.cbrt(np.linalg.det(pose[:9].reshape(3, 3))) * shape.surface.distances(local)
    drawn = counts[:, DRAWN]
    covered = max(1, int(drawn[:, [BOTH, SHAPE_ONLY]].sum()))
    return Alignment(
        shape.name,
        world_from_canonical @ shape.canonical_from_own,
        float(parts.sum()),
        float(parts[POINTS]),
        float(np.median(distances)) if len(distances) else float("nan"),
        float(1 - misfits[problem.shown].mean()),
        float(drawn[:, FREE].sum() / covered),
        float(parts[OUTSIDE]),
        np.where(problem.shown, 1 - misfits, np.nan),
    )


def _starts(shape: Shape, evidence: ObjectEvidence, headings: int, sizes: Sequence[float]) -> np.ndarray:
    """(K, 12) poses: each of the six axes upright, every heading, a few sizes, on the floor or not."""
    poses = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            upright = _upright(axis, sign)
            for heading in range(headings):
                turn = Rotation.from_euler("z", heading * 2 * np.pi / headings).as_matrix()
                rotation = turn @ upright
                height = -(shape.drawn[0][0] @ rotation.T)[:, 2].min()
                for centre, size in evidence.guesses:
                    for scale in size * np.array(sizes):
                        for place in (centre, (*centre[:2], height * scale)):
                            poses.append(np.concatenate([scale * rotation.ravel(), place]))
    return np.array(poses)


def _turned(shape: Shape, problem: Problem, pose: np.ndarray, count: int) -> np.ndarray:
    """The pose with the shape turned over in its box: what small images cannot tell apart."""
    linear = pose[:9].reshape(3, 3)
    turns = np.array(
        [np.concatenate([(linear @ turn).ravel(), pose[9:]]) for turn in Rotation.create_group("O").as_matrix()]
    )
    turns = turns[np.argsort(energies(problem, turns), kind="stable")]
    return _distinct(shape, turns, count)


def _upright(axis: int, sign: float) -> np.ndarray:
    """A rotation that takes an axis of the canonical frame to z, up or down."""
    up = np.zeros(3)
    up[axis] = sign
    ahead = np.roll(np.abs(up), 1)
    return np.stack([ahead, np.cross(up, ahead), up])


def _distinct(shape: Shape, poses: np.ndarray, count: int) -> np.ndarray:
    """The first poses that are turned differently: a round table has but one heading."""
    samples = shape.surface.samples[:: max(1, len(shape.surface.samples) // _COMPARED)]
    kept: list[np.ndarray] = []
    turns: list[np.ndarray] = []
    for pose in poses:
        linear = pose[:9].reshape(3, 3)
        turn = linear / np.cbrt(np.linalg.det(linear))
        turned = samples @ turn.T
        if all(
            rotation_angle_rad(turn, other) > _NEAR_TURN
            and shape.surface.distances(turned @ other).mean() > _SAME_SURFACE
            for other in turns
        ):
            kept.append(pose)
            turns.append(turn)
            if len(kept) == count:
                break
    return np.array(kept)


def _windows(
    cameras: Sequence[Camera], masks: Sequence[np.ndarray], depths: Sequence[np.ndarray], scale: float, margin: float
) -> tuple[list[Camera], list[np.ndarray], list[np.ndarray]]:
    """The images at a scale, cut to the masks' surroundings."""
    windows: tuple[list, list, list] = ([], [], [])
    for camera, mask, depth in zip(cameras, masks, depths, strict=True):
        scaled = camera.scaled(scale)
        size = (scaled.width, scaled.height)
        mask = np.sum([cv2.resize(one, size, interpolation=cv2.INTER_AREA) > 0.5 for one in _widths(mask)], 0)
        depth = resize_nearest(depth.astype(np.float32), *scaled.shape)
        rows, columns = _surroundings(mask, margin)
        shifted = Camera(
            columns.stop - columns.start,
            rows.stop - rows.start,
            scaled.fx,
            scaled.fy,
            scaled.cx - columns.start,
            scaled.cy - rows.start,
            scaled.world_from_camera,
        )
        for kept, one in zip(windows, (shifted, mask[rows, columns], depth[rows, columns]), strict=True):
            kept.append(one)
    return windows


def _triangulated(cameras: Sequence[Camera], masks: Sequence[np.ndarray]) -> tuple[np.ndarray, float]:
    """Where the rays through the masks' middles meet best, and the size masks have there."""
    normal, right = np.zeros((3, 3)), np.zeros(3)
    boxes = []
    for camera, mask in zip(cameras, masks, strict=True):
        rows, columns = (np.flatnonzero(mask.any(1 - axis)) for axis in range(2))
        boxes.append(np.hypot((np.ptp(rows) + 1) / camera.fy, (np.ptp(columns) + 1) / camera.fx))
        middle = [(columns.mean() + 0.5 - camera.cx) / camera.fx, (rows.mean() + 0.5 - camera.cy) / camera.fy, 1]
        ray = camera.world_from_camera[:3, :3] @ middle
        ray /= np.linalg.norm(ray)
        across = np.eye(3) - np.outer(ray, ray)
        normal += across
        right += across @ camera.centre
    centre = np.linalg.lstsq(normal, right, rcond=None)[0]
    depths = [max(camera.project(centre)[1], 0.1) for camera in cameras]
    return centre, float(np.median(np.array(boxes) * depths))


def _widths(mask: np.ndarray) -> list[np.ndarray]:
    """The mask a pixel wider, as it is, and a pixel narrower, as float32."""
    square, drawn = np.ones((3, 3), np.uint8), mask.astype(np.uint8)
    widths = (cv2.dilate(drawn, square), drawn, cv2.erode(drawn, square))
    return [one.astype(np.float32) for one in widths]


def _at_border(mask: np.ndarray) -> bool:
    """Whether the image may cut the object off."""
    return bool(mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any())


def _surroundings(mask: np.ndarray, share: float) -> tuple[slice, slice]:
    """Rows and columns of a mask and of what lies around it; all of them for an empty one."""
    mask = mask > DRAWN
    if not mask.any():
        return slice(0, mask.shape[0]), slice(0, mask.shape[1])
    cut = []
    for axis in range(2):
        used = np.flatnonzero(mask.any(1 - axis))
        margin = 4 + round(share * (used[-1] - used[0] + 1))
        cut.append(slice(max(0, used[0] - margin), min(mask.shape[axis], used[-1] + 1 + margin)))
    return cut[0], cut[1]
