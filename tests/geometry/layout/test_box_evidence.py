"""What speaks for a box of the room, beside its definition."""

from __future__ import annotations

import numpy as np
import pytest

from r2sego_blender.geometry.layout.box_evidence import BoxEvidence
from r2sego_blender.geometry.layout.room_box import FLOOR
from r2sego_blender.geometry.layout.segments import ASTRAY, UPRIGHT

CLUSTERS, BINS, EDGE_RAD = 40, 200, 0.008
ROWS, COLUMNS = 9, 12
CENTRES = np.array([[0.2, -0.3, 1.4], [-0.5, 0.4, 1.2]])


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def made_up(rng: np.random.Generator) -> BoxEvidence:
    """Of two captures: a grid of pixels each, and rays to edges and corners of a room of about 5 by 4 m."""
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, COLUMNS), np.linspace(0.8, -0.8, ROWS)), -1).reshape(-1, 2)
    count = len(grid)
    rays = unit(np.concatenate([[[x, 1.0, z] for x, z in grid], [[1.0, -x, z] for x, z in grid]]))
    low, high = np.array([-2.5, -2.0, 0.0]), np.array([2.5, 2.0, 2.5])
    ends = np.where(rng.random((300, 3)) < 0.5, low, high)
    free = rng.integers(0, 3, 300)
    ends[np.arange(300), free] = rng.uniform(low, high, (300, 3))[np.arange(300), free]
    views = rng.integers(0, 2, 300)
    kinds = np.where(rng.random(300) < 0.1, ASTRAY, free)
    return BoxEvidence(
        pixel_rays=rays,
        pixel_views=np.repeat([0, 1], count),
        row_of=np.tile(np.where(np.arange(count) >= COLUMNS, COLUMNS, 0), 2),
        colours=rng.integers(0, CLUSTERS, 2 * count),
        floor_like=rng.normal(size=CLUSTERS),
        known=np.where(rng.random(2 * count) < 0.3, 0.0, rng.uniform(1.0, 4.0, 2 * count)),
        line_rays=unit(ends - CENTRES[views] + rng.normal(0.0, 0.01, (300, 3))),
        line_views=views,
        line_directions=kinds,
        line_feet=rng.random(300),
        centres=CENTRES,
        finer=1.0,
    )


def side_of(box, origin, ray) -> tuple[int, float]:
    """Which side of a box a ray from within leaves it by, and how far away."""
    low, high = np.array([box[0], box[2], 0.0]), np.array([box[1], box[3], box[4]])
    with np.errstate(divide="ignore"):
        away = np.where(ray == 0, np.inf, np.where(ray > 0, high - origin, low - origin) / ray)
    axis = int(np.argmin(away))
    return 2 * axis + int(ray[axis] > 0), float(away[axis])


def near(to_edge, ray) -> float:
    """In a plane across an edge: how well a ray's direction is that to it."""
    if to_edge @ ray <= 0:
        return 0.0
    off = (to_edge[0] * ray[1] - to_edge[1] * ray[0]) / (np.linalg.norm(to_edge) * np.linalg.norm(ray)) / EDGE_RAD
    return float(np.exp(-0.5 * off**2)) if abs(off) < 3.0 else 0.0


def terms(evidence: BoxEvidence, box: np.ndarray) -> np.ndarray:
    """``BoxEvidence.terms`` of one box, by what its weights say they are of."""
    sides = [side_of(box, CENTRES[v], r) for v, r in zip(evidence.pixel_views, evidence.pixel_rays, strict=True)]
    side, distance = np.array([one for one, _ in sides]), np.array([far for _, far in sides])
    joint = np.zeros((6, CLUSTERS))
    np.add.at(joint, (side, evidence.colours), 1.0 / len(side))
    independent = joint.sum(1, keepdims=True) * joint.sum(0, keepdims=True)
    told = np.where(joint > 0, joint * np.log(np.where(joint > 0, joint, 1.0) / np.maximum(independent, 1e-12)), 0.0)
    unlike = np.minimum(evidence.floor_like[evidence.colours[side == FLOOR]], 0.0).sum() / len(side)
    ratio = distance[evidence.known > 0] / evidence.known[evidence.known > 0]
    before, known = (ratio < 0.95).sum() / len(side), ((ratio >= 0.95) & (ratio < 1.05)).sum() / len(side)
    seen = {FLOOR: 0, FLOOR + 1: 0}
    for picture in side.reshape(2, ROWS, COLUMNS):  # a pixel beside the last of the row before, too
        flat = picture.ravel()
        for back in (1, COLUMNS):
            for a, b in zip(flat[COLUMNS:], flat[COLUMNS - back : len(flat) - back], strict=True):
                if a != b and max(a, b) >= FLOOR:
                    seen[max(a, b)] += 1

    on_wall = on_floor = wrong = 0
    corners, feet, ceiling = np.zeros((2, 4, BINS)), np.zeros((2, 8, BINS)), np.zeros((2, 4, BINS))
    for ray, view, kind, foot in zip(
        evidence.line_rays, evidence.line_views, evidence.line_directions, evidence.line_feet, strict=True
    ):
        if kind == ASTRAY:
            continue
        origin, shown = CENTRES[view], side_of(box, CENTRES[view], ray)[0]
        along = int((ray[kind] + 1.0) * 0.499 * BINS)
        if kind == UPRIGHT:
            on_wall += shown < FLOOR
            on_floor += shown == FLOOR
            wrong += shown > FLOOR
            if shown < FLOOR:
                for number, (x, y) in enumerate((x, y) for x in box[:2] for y in box[2:4]):
                    found = near(np.array([x, y]) - origin[:2], ray[:2])
                    corners[view, number, along] = max(corners[view, number, along], found)
        elif shown // 2 == kind:  # on a wall across it, of which it is no line
            wrong += 1
        else:
            across = [1 - kind, 2]
            for number, wall in enumerate(box[2 * (1 - kind) : 2 * (1 - kind) + 2]):
                edge = 2 * (1 - kind) + number
                at = {z: near(np.array([wall, z]) - origin[across], ray[across]) for z in (0.0, box[4], box[5])}
                feet[view, edge, along] = max(feet[view, edge, along], foot * at[0.0])
                ceiling[view, edge, along] = max(ceiling[view, edge, along], at[box[4]])
                if box[5] > 0.0:
                    feet[view, 4 + edge, along] = max(feet[view, 4 + edge, along], at[box[5]])
    feet[:, 4:] = np.minimum(feet[:, 4:], feet[:, :4])  # a skirting board is over its foot
    lines, edges = 2 * 100.0, np.sqrt(len(side)) * 2
    return np.array(
        [
            told.sum(),
            unlike,
            before,
            known,
            *(np.array([on_wall, on_floor, wrong, corners.sum(), feet.sum(), ceiling.sum()]) / lines),
            seen[FLOOR] / edges,
            seen[FLOOR + 1] / edges,
            0.5 * ((box[4] - 2.5) / 0.25) ** 2,
            np.log((box[1] - box[0]) * (box[3] - box[2])),
        ]
    )


@pytest.mark.parametrize("seed", range(4))
def test_the_terms_are_their_plain_reference(seed):
    rng = np.random.default_rng(seed)
    evidence = made_up(rng)
    boxes = np.array([-2.5, 2.5, -2.0, 2.0, 2.5, 0.08]) + rng.normal(0.0, [*[0.3] * 4, 0.1, 0.0], (5, 6))
    boxes[0] = [-2.5, 2.5, -2.0, 2.0, 2.5, 0.08]
    boxes[1, 5] = 0.0  # without a skirting board
    expected = np.array([terms(evidence, box) for box in boxes])
    assert (expected[0, 7:10] > 0.0).all()  # corners, feet and ceiling of the true box are covered
    np.testing.assert_allclose(evidence.terms(boxes), expected, rtol=1e-5, atol=1e-7)
