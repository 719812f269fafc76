"""The box that explains all captures best: the poses are known, so all of them vote for one room."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.cameras import Camera
from .box_evidence import BoxEvidence, box_evidence
from .room_box import RoomBox
from .segments import Segments, level_turn, room_axes

_USUAL_HEIGHT_M = 2.5
_LEAST_HEIGHT_M, _MOST_HEIGHT_M = 2.2, 4.5
_NEAREST_WALL_M, _FARTHEST_WALL_M = 0.25, 9.0
_REFINED = 4  # of the starts
_TEMPERATURE = 3.0  # by how much a score falls where a box is e times less likely, as made-up rooms tell
_STARTS = (0.5, 1.2, 2.2, 3.5)  # metres from the outermost captures


def find_box(
    images: Sequence[np.ndarray],
    cameras: Sequence[Camera],
    segments: Segments,
    known: Sequence[np.ndarray] = (),
    seed: int = 0,
) -> tuple[RoomBox, float]:
    """The box that explains pictures (H, W, 3) float32 in [0, 1] of ``cameras`` best, and its score."""
    turn, share = level_turn(segments)
    axes = room_axes(turn)
    centres = np.array([camera.centre for camera in cameras]) @ axes.T
    known = known or [np.zeros(camera.shape, np.float32) for camera in cameras]
    coarse, evidence = (box_evidence(images, cameras, known, segments, turn, seed, finer) for finer in (5.0, 1.0))
    inner = np.concatenate([centres.min(0)[:2] - _NEAREST_WALL_M, centres.max(0)[:2] + _NEAREST_WALL_M])[[0, 2, 1, 3]]
    outward = np.array([-1.0, 1.0, -1.0, 1.0])
    least_height = max(_LEAST_HEIGHT_M, float(centres[:, 2].max()) + 0.2)
    away = np.geomspace(1.0, 1.0 + _FARTHEST_WALL_M, 70) - 1.0
    heights = np.linspace(least_height, _MOST_HEIGHT_M, 40)
    skirtings = np.append(0.0, np.arange(0.04, 0.16, 0.01))
    grids = [inner[k] + outward[k] * away for k in range(4)] + [heights, skirtings]
    climbed = []
    for start in _STARTS:
        for skirting in (0.0, 0.08):
            box = np.concatenate([inner + outward * start, [max(_USUAL_HEIGHT_M, least_height), skirting]])
            climbed.append(_climbed(coarse, box, [*grids[:5], np.array([skirting])]))
    climbed.sort(key=lambda found: -found[1])
    refined = [_climbed(evidence, box, grids) for box, _ in climbed[:_REFINED]]
    best, best_score = max(refined, key=lambda found: found[1])
    for width in (0.1, 0.02):
        fine = [best[k] + np.linspace(-width, width, 21) * (1.0 + abs(best[k]) * 0.2) for k in range(5)]
        best, best_score = _climbed(evidence, best, [*fine, skirtings])
    sigma = np.hypot(_spread(evidence, best, grids), _apart(refined, best, best_score))
    low, high = np.array([best[0], best[2], 0.0]), np.array([best[1], best[3], best[4]])
    return RoomBox(turn, low, high, sigma, share), best_score


def _climbed(evidence: BoxEvidence, box: np.ndarray, grids: Sequence[np.ndarray]) -> tuple[np.ndarray, float]:
    """The box moved one side after the other to the best place of its grid until none moves."""
    score = float(evidence.scores(box[None])[0])
    for _ in range(6):
        before = score
        for k, grid in enumerate(grids):
            tried = np.repeat(box[None], len(grid), 0)
            tried[:, k] = grid
            scores = evidence.scores(tried)
            if scores.max() > score:
                box, score = tried[scores.argmax()], float(scores.max())
        for k in range(4) if score <= before + 1e-9 else ():  # a wall and the ceiling are told apart by little
            tried = _together(box, k, grids)
            scores = evidence.scores(tried)
            if scores.max() > score:
                box, score = tried[scores.argmax()], float(scores.max())
        if score <= before + 1e-9:
            break
    return box, score


def _together(box: np.ndarray, wall: int, grids: Sequence[np.ndarray]) -> np.ndarray:
    places, heights = np.meshgrid(grids[wall][::3], grids[4][::3], indexing="ij")
    tried = np.repeat(box[None], places.size, 0)
    tried[:, wall], tried[:, 4] = places.ravel(), heights.ravel()
    return tried


def _apart(found: Sequence[tuple[np.ndarray, float]], best: np.ndarray, score: float) -> np.ndarray:
    """(6,) metres, as ``_spread``: how far other good boxes are from the best, by how nearly they are as good."""
    weight = np.exp((np.array([one for _, one in found]) - score) / _TEMPERATURE)
    off = np.array([box for box, _ in found])[:, [0, 1, 2, 3, 4]] - best[:5]
    sigma = np.sqrt((weight[:, None] * off**2).sum(0) / max(float(weight.sum()), 1e-9))
    return np.insert(sigma, 4, 0.0)


def _spread(evidence: BoxEvidence, box: np.ndarray, grids: Sequence[np.ndarray]) -> np.ndarray:
    """(6,) metres: how far each side may be off, by how much worse the score is elsewhere."""
    sigma = np.zeros(6)
    for k, side in enumerate((0, 1, 2, 3, 5)):
        places = np.unique(np.concatenate([grids[k], box[k] + np.linspace(-0.3, 0.3, 61)]))
        tried = np.repeat(box[None], len(places), 0)
        tried[:, k] = places
        scores = evidence.scores(tried)
        weight = np.exp((scores - scores.max()) / _TEMPERATURE) * np.gradient(places)
        sigma[side] = np.sqrt((weight * (places - box[k]) ** 2).sum() / weight.sum())
    return np.maximum(sigma, 0.02) * [1, 1, 1, 1, 0, 1]
