"""The energy of poses against what it should say, and its search."""

import numpy as np
import pytest
from furniture import (
    FURNITURE,
    cameras_around,
    moved,
    narrower,
    observed_object,
    random_similarity,
    room_bounds,
    standing,
    wider,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from r2sego_blender.geometry.objects.pose_search import (
    MISFIT,
    OTHER_WIDTH,
    OUTSIDE,
    OUTSIDE_REACH_M,
    OUTSIDE_SLACK_M,
    PARTS,
    POINTS,
    Problem,
    energies,
    energy_parts,
    refined,
)
from r2sego_blender.geometry.objects.shapes import Shape
from r2sego_blender.geometry.objects.silhouettes import DRAWN, WIDER, MaskViews, scratch

WORLD_FROM_CHAIR = standing(75.0, (0.2, -0.1))
STEPS = np.array([[0.12, 0.12, 0.12, 0.06, 0.05, 0.05, 0.05]])


@pytest.fixture(scope="module")
def chair() -> Shape:
    return Shape.of("chair", *FURNITURE["chair"]())


@pytest.fixture(scope="module")
def problem(chair) -> Problem:
    cameras = cameras_around((0.2, -0.1, 0.5), count=3, width=160)
    vertices = moved(chair.vertices, WORLD_FROM_CHAIR)
    seen = observed_object(vertices, chair.faces, cameras, np.random.default_rng(2), noise_m=0.002, count=300)
    masks = [wider(m).astype(np.uint8) + m + narrower(m) for m in seen.masks]
    bounds, mean_area_px = room_bounds(), float(np.mean([m.sum() for m in seen.masks]))
    return Problem(
        MaskViews.of(cameras, masks, seen.depths),
        np.ones(3, bool),
        mean_area_px,
        np.ascontiguousarray(seen.points),
        0.05,
        bounds.normals,
        bounds.offsets,
        *chair.drawn[2],
        chair.surface,
    )


def pose_of(world_from_own: np.ndarray, shape: Shape) -> np.ndarray:
    """The row of twelve of a similarity of the own frame."""
    pose = world_from_own @ np.linalg.inv(shape.canonical_from_own)
    return np.concatenate([pose[:3, :3].ravel(), pose[:3, 3]])


def parts_of(problem: Problem, pose: np.ndarray) -> np.ndarray:
    counts = np.empty((len(problem.shown), 3, 4), np.int64)
    return energy_parts(problem, pose, *scratch(problem.views.sizes, len(problem.vertices)), counts)


def changed(pose: np.ndarray, turn_rad=(0, 0, 0), growth=1.0, shift_m=(0, 0, 0)) -> np.ndarray:
    linear = growth * Rotation.from_rotvec(turn_rad).as_matrix() @ pose[:9].reshape(3, 3)
    return np.concatenate([linear.ravel(), pose[9:] + shift_m])


def test_the_true_pose_explains_everything(problem, chair):
    parts = parts_of(problem, pose_of(WORLD_FROM_CHAIR, chair))
    assert len(parts) == PARTS
    assert parts[MISFIT] < 0.02
    assert parts[POINTS] < 0.08
    assert abs(parts[OUTSIDE]) < 1e-9
    assert energies(problem, pose_of(WORLD_FROM_CHAIR, chair)[None])[0] == pytest.approx(parts.sum())


@pytest.mark.parametrize("seed", range(4))
def test_the_energy_rises_with_shift_turn_and_scale(problem, chair, seed):
    true = pose_of(WORLD_FROM_CHAIR, chair)
    way = np.random.default_rng(seed).normal(size=3)
    way /= np.linalg.norm(way)
    growing = 0.02 * 2.0 ** np.arange(4)
    for changes in (
        [changed(true, shift_m=step * way) for step in growing],
        [changed(true, turn_rad=2 * step * way) for step in growing],
        [changed(true, growth=1 + step) for step in growing],
        [changed(true, growth=1 / (1 + step)) for step in growing],
    ):
        found = energies(problem, np.array([true, *changes]))
        assert (np.diff(found) > 0).all()
        misfits = [parts_of(problem, pose)[MISFIT] for pose in (true, *changes)]
        assert (np.diff(misfits) > 0).all()


def test_a_mask_drawn_too_far_out_is_taken_for_wider_at_a_price(problem, chair):
    true = pose_of(WORLD_FROM_CHAIR, chair)
    masks = problem.views.masks

    def misfit(masks):
        views = problem.views._replace(masks=masks.astype(np.uint8))
        return parts_of(problem._replace(views=views), true)[MISFIT]

    exact = misfit(3 * (masks > DRAWN))
    too_wide = misfit(3 * (masks > WIDER))
    with_its_narrower_outline = misfit(np.minimum(masks + 1, 3) * (masks > WIDER))
    assert too_wide > exact + 0.1
    assert misfit(masks) == exact
    assert with_its_narrower_outline == pytest.approx(exact + OTHER_WIDTH)


def test_where_the_mask_shows_too_little_only_what_is_too_much_counts(problem, chair):
    true = pose_of(WORLD_FROM_CHAIR, chair)
    views = problem.views._replace(masks=np.zeros_like(problem.views.masks))
    empty = problem._replace(views=views, shown=np.zeros(3, bool))
    areas = [(part > DRAWN).sum() for part in np.split(problem.views.masks, problem.views.starts[1:])]
    expected = np.minimum(areas / np.mean(areas), 1).mean()
    assert parts_of(empty, true)[MISFIT] == pytest.approx(expected, abs=0.01)
    assert parts_of(empty, changed(true, shift_m=(0, 0, 50.0)))[MISFIT] == 0.0


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_outside_counts_the_vertices_beyond_the_slack(problem, chair, seed):
    """Against NumPy; 0 within the slack, 1 beyond the reach."""
    rng = np.random.default_rng(seed)
    pose = pose_of(random_similarity(rng), chair)
    pose[9:] *= rng.uniform(0, 4)
    world = problem.vertices @ pose[:9].reshape(3, 3).T + pose[9:]
    depth = (problem.offsets - world @ problem.normals.T).max(1)
    share = np.clip((depth - OUTSIDE_SLACK_M) / (OUTSIDE_REACH_M - OUTSIDE_SLACK_M), 0, 1)
    assert parts_of(problem, pose)[OUTSIDE] == pytest.approx(share.mean(), abs=1e-9)


def test_slack_and_reach_of_what_is_outside(problem, chair):
    floor = problem._replace(normals=np.array([[0.0, 0.0, 1.0]]), offsets=np.zeros(1))
    pose = pose_of(WORLD_FROM_CHAIR, chair)  # stands on the floor
    assert abs(parts_of(floor, changed(pose, shift_m=(0, 0, 0.001 - OUTSIDE_SLACK_M)))[OUTSIDE]) < 1e-9
    under = [parts_of(floor, changed(pose, shift_m=(0, 0, -depth)))[OUTSIDE] for depth in (0.04, 0.1, 0.5)]
    assert 0 < under[0] < under[1] < under[2] < 1
    height = np.ptp(chair.vertices[:, 2])
    below = changed(pose, shift_m=(0, 0, -height - OUTSIDE_REACH_M - 0.001))
    assert parts_of(floor, below)[OUTSIDE] == pytest.approx(1.0)


@pytest.fixture(scope="module")
def starts(chair) -> np.ndarray:
    rng = np.random.default_rng(6)
    true = pose_of(WORLD_FROM_CHAIR, chair)
    return np.array(
        [
            changed(true, rng.normal(size=3) * 0.15, np.exp(rng.normal() * 0.1), rng.normal(size=3) * 0.08)
            for _ in range(6)
        ]
    )


def test_a_search_never_ends_worse_than_it_began(problem, starts):
    given = starts.copy()
    poses, found = refined(problem, starts, np.concatenate([STEPS, 0.5 * STEPS]), 60)
    np.testing.assert_array_equal(starts, given)
    assert (found <= energies(problem, starts)).all()
    np.testing.assert_allclose(energies(problem, poses), found, rtol=1e-12)
    assert np.median(found) < 0.7 * np.median(energies(problem, starts))
    for pose in poses:
        linear = pose[:9].reshape(3, 3)
        scale = np.cbrt(np.linalg.det(linear))
        np.testing.assert_allclose(linear @ linear.T, scale**2 * np.eye(3), atol=1e-9)


def test_a_search_with_too_few_evaluations_returns_where_it_began_or_better(problem, starts):
    _, found = refined(problem, starts, STEPS, 1)
    assert (found <= energies(problem, starts)).all()


def test_a_near_start_ends_at_the_true_pose(problem, chair):
    true = pose_of(WORLD_FROM_CHAIR, chair)
    start = changed(true, (0.03, -0.05, 0.1), 1.06, (0.03, -0.04, 0.02))
    steps = np.concatenate([0.5**k * STEPS for k in range(3)])
    pose = refined(problem, start[None], steps, 200)[0][0]
    assert np.linalg.norm(pose[9:] - true[9:]) < 0.01
    np.testing.assert_allclose(pose[:9], true[:9], atol=0.02)


def test_one_thread_and_two_find_the_same_bits(problem, starts, with_threads):
    def found():
        return energies(problem, starts), *refined(problem, starts, STEPS, 40)

    for one, two in zip(with_threads(1, found), with_threads(2, found), strict=True):
        np.testing.assert_array_equal(one, two)


def test_points_weigh_what_the_problem_says(problem, chair):
    pose = pose_of(standing(82.0, (0.22, -0.1)), chair)
    parts = parts_of(problem, pose)
    assert parts[POINTS] > 0.1
    lighter = problem._replace(point_weight=0.25)
    assert energies(lighter, pose[None])[0] == pytest.approx(parts.sum() - 0.75 * parts[POINTS], abs=1e-12)
