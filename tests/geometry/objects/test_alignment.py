"""Alignment against objects whose true pose is known: made-up furniture in a made-up room."""

from dataclasses import fields

import numpy as np
import pytest
from furniture import FURNITURE, cameras_around, moved, observed_object, random_similarity, standing, wider
from scipy.spatial.transform import Rotation

from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.objects.alignment import ObjectEvidence, align, rated, realigned, screened
from r2sego_blender.geometry.objects.shapes import Shape
from tools.benchmarks.truth.geometry_scores import alignment_score

CHAIR = FURNITURE["chair"]()
WORLD_FROM_CHAIR = standing(130.0, (0.3, 0.2), scale=1.1)


@pytest.fixture(scope="module")
def seen():
    vertices, faces = CHAIR
    cameras = cameras_around((0.3, 0.2, 0.5), count=4)
    return observed_object(moved(vertices, WORLD_FROM_CHAIR), faces, cameras, np.random.default_rng(5))


def evidence_of(seen, **changes) -> ObjectEvidence:
    known = vars(seen) | changes
    return ObjectEvidence.of(
        "chair", known["cameras"], known["masks"], known["depths"], known["points"], known["bounds"]
    )


@pytest.fixture(scope="module")
def evidence(seen):
    return evidence_of(seen)


def chair_in_a_frame_of_its_own(seed):
    """The chair, turned, scaled and shifted, and where it truly stands."""
    own_from_chair = random_similarity(np.random.default_rng(seed))
    shape = Shape.of("chair", moved(CHAIR[0], own_from_chair), CHAIR[1])
    return shape, WORLD_FROM_CHAIR @ np.linalg.inv(own_from_chair)


def score(alignment, shape, truth):
    rng = np.random.default_rng(0)
    return alignment_score(alignment.world_from_own, truth, shape.vertices, shape.faces, rng)


def assert_true(found, limit_m=0.01, limit_deg=1.0, limit_percent=1.0):
    assert found.translation_m < limit_m
    assert found.rotation_deg < limit_deg
    assert found.scale_percent < limit_percent


@pytest.fixture(scope="module")
def aligned(evidence):
    shape, truth = chair_in_a_frame_of_its_own(0)
    return align(shape, evidence), shape, truth


def test_a_chair_in_a_frame_of_its_own_comes_back_to_its_place(aligned):
    alignment, shape, truth = aligned
    assert_true(score(alignment, shape, truth))
    assert alignment.silhouette_iou > 0.95 and alignment.energy < 0.2
    assert alignment.scale == pytest.approx(np.cbrt(np.linalg.det(truth[:3, :3])), rel=0.01)
    assert alignment.point_distance_m < 0.01
    assert alignment.outside == pytest.approx(0.0, abs=1e-12)


def test_masks_a_pixel_wider_in_half_of_the_views_do_no_harm(seen):
    shape, truth = chair_in_a_frame_of_its_own(1)
    drawn = [wider(mask) if view % 2 else mask for view, mask in enumerate(seen.masks)]
    assert_true(score(align(shape, evidence_of(seen, masks=drawn)), shape, truth))


def test_the_same_input_gives_the_same_bits(aligned, seen):
    alignment, shape, _ = aligned
    again = align(shape, evidence_of(seen))
    for field in fields(alignment):
        np.testing.assert_array_equal(getattr(again, field.name), getattr(alignment, field.name))


def test_a_given_pose_is_rated_by_what_it_explains(aligned, evidence):
    """Shifted by 15 cm, half as large again or turned round, the true pose explains less."""
    _, shape, truth = aligned
    true = rated(shape, evidence, truth)
    np.testing.assert_allclose(true.world_from_own, truth, atol=1e-12)
    assert true.energy < 0.15 and true.point_distance_m < 0.005 and true.free_space < 0.02
    assert (true.ious > 0.95).all()
    for heading, place, scale in ((130, (0.45, 0.2), 1.1), (130, (0.3, 0.2), 1.6), (-50, (0.3, 0.2), 1.1)):
        wrong = standing(heading, place, scale) @ np.linalg.inv(WORLD_FROM_CHAIR) @ truth
        found = rated(shape, evidence, wrong)
        assert found.energy > true.energy + 0.2
        assert found.silhouette_iou < 0.8 and found.free_space > 0.1


def test_what_reaches_through_a_wall_is_outside(aligned, evidence):
    _, shape, truth = aligned
    beyond = np.eye(4)
    beyond[0, 3] = 5.0
    assert rated(shape, evidence, beyond @ truth).outside == pytest.approx(1.0)


def test_the_small_images_tell_the_chair_from_others(evidence):
    chair, _ = chair_in_a_frame_of_its_own(2)
    others = [Shape.of(name, *make()) for name, make in FURNITURE.items() if name != "chair"]
    found = screened([*others, chair], evidence, count=2)
    assert min(found, key=found.get) == "chair" and found["chair"] < 0.4
    assert set(found) == set(FURNITURE)


def test_evidence_keeps_what_is_needed_of_points_and_masks(seen, evidence):
    assert len(evidence.points) == len(seen.points)
    many = evidence_of(seen, points=np.tile(seen.points, (3, 1)))
    assert len(many.points) < 2 * len(seen.points)
    centre = moved(CHAIR[0], WORLD_FROM_CHAIR)
    size = np.linalg.norm(np.ptp(centre, axis=0))
    centre = (centre.min(0) + centre.max(0)) / 2
    assert len(evidence.guesses) == 2 and len(evidence_of(seen, points=seen.points[:9]).guesses) == 1
    for guess, length in evidence.guesses:
        assert np.linalg.norm(guess - centre) < 0.15 and abs(length / size - 1) < 0.3
    assert [views.masks.size for views in evidence.views] == sorted(v.masks.size for v in evidence.views)


def test_a_mask_that_shows_too_little_has_no_overlap(aligned, seen):
    _, shape, truth = aligned
    masks = [np.zeros_like(mask) if view == 0 else mask for view, mask in enumerate(seen.masks)]
    found = rated(shape, evidence_of(seen, masks=masks), truth)
    assert np.isnan(found.ious[0]) and (found.ious[1:] > 0.95).all()


def test_an_object_that_no_mask_shows_is_an_error(seen):
    with pytest.raises(GeometryError, match="chair: no mask shows the object"):
        evidence_of(seen, masks=[np.zeros_like(mask) for mask in seen.masks])


def test_a_pose_set_roughly_by_hand_is_made_exact(evidence):
    shape, truth = chair_in_a_frame_of_its_own(3)
    by_hand = np.eye(4)
    by_hand[:3, :3] = 1.04 * Rotation.from_rotvec([0.02, -0.03, 0.1]).as_matrix()
    by_hand[:3, 3] = WORLD_FROM_CHAIR[:3, 3] - by_hand[:3, :3] @ WORLD_FROM_CHAIR[:3, 3] + (0.03, -0.02, 0.01)
    assert rated(shape, evidence, by_hand @ truth).energy > 0.3
    assert_true(score(realigned(shape, evidence, by_hand @ truth), shape, truth))


def test_points_that_are_all_a_little_wrong_turn_nothing(seen):
    """Points a centimetre thick, of a chair turned by 6 degrees: by fixed weights it turns by 3."""
    shape, truth = chair_in_a_frame_of_its_own(4)
    rng, middle = np.random.default_rng(9), seen.points.mean(0)
    turn = Rotation.from_euler("z", 6.0, degrees=True).as_matrix()
    fattened = (seen.points - middle) @ turn.T + middle + rng.uniform(-0.01, 0.01, seen.points.shape)
    evidence = evidence_of(seen, points=fattened)
    found = score(realigned(shape, evidence, truth), shape, truth)
    assert_true(found, limit_deg=0.5)
