"""Scores against shapes whose distances are known, and against brute force."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from room_meshes import plate
from scipy.spatial.transform import Rotation

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import EvaluationError
from r2sego_blender.evaluation.ground_truth import GroundTruth, TrueView
from r2sego_blender.evaluation.surfaces.geometry_errors import Surface
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer
from tools.benchmarks.truth import geometry_scores
from tools.benchmarks.truth.geometry_scores import alignment_score, chamfer_distance_m, depth_score, mesh_score


@pytest.fixture(scope="module", autouse=True)
def fewer_samples():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(geometry_scores, "FOUND_SAMPLES", 30_000)
        patch.setattr(geometry_scores, "TRUE_SAMPLES", 60_000)
        patch.setattr(geometry_scores, "_PRIOR_SAMPLES", 5_000)
        yield


def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def turns(count: int, axis: np.ndarray, centre: np.ndarray) -> list[np.ndarray]:
    """The symmetries of a shape that repeats ``count`` times round an axis, identity left out."""
    angles = 2.0 * np.pi * np.arange(1, count) / count
    return [trimesh.transformations.rotation_matrix(angle, axis, centre) for angle in angles]


def similarity(scale: float, rotation: Rotation, translation) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = scale * rotation.as_matrix(), translation
    return matrix


# ---- depth maps


def test_coverage_is_of_all_pixels_and_accuracy_of_those_covered():
    true = np.full((10, 10), 2.0, np.float32)
    found = np.zeros((10, 10), np.float32)
    found[:6] = 2.0 * 1.029  # 60 pixels, right
    found[4:6] = 2.0 * 0.96  # 20 of them wrong
    score = depth_score([found], [true])
    assert score.coverage == pytest.approx(0.6)
    assert score.accuracy == pytest.approx(2 / 3)


def test_unknown_truth_accuses_nobody_and_maps_count_by_their_pixels():
    true = np.full((4, 4), 3.0, np.float32)
    unknown = true.copy()
    unknown[:2] = 0.0
    found = np.full((4, 4), 3.0, np.float32)
    found[0] = 9.0
    assert depth_score([found], [unknown]).accuracy == 1.0
    assert depth_score([found], [true]).accuracy == pytest.approx(0.75)
    empty = np.zeros((4, 4), np.float32)
    assert depth_score([found, empty], [true, true]).coverage == pytest.approx(0.5)
    assert depth_score([empty], [true]) == replace(depth_score([empty], [true]), coverage=0.0, accuracy=0.0)


def test_truth_of_another_size_is_brought_to_the_map():
    true = np.repeat(np.repeat([[1.0, 2.0], [3.0, 4.0]], 4, axis=0), 4, axis=1).astype(np.float32)
    found = np.array([[1.0, 2.0], [3.0, 4.0]], np.float32)
    assert depth_score([found], [true]).accuracy == 1.0


def test_maps_without_a_counterpart_are_refused():
    with pytest.raises(EvaluationError, match="1 depth maps"):
        depth_score([np.ones((2, 2), np.float32)], [])
    with pytest.raises(EvaluationError):
        depth_score([], [])


# ---- surfaces


@pytest.fixture(scope="module")
def truth() -> GroundTruth:
    """A floor of 2 m by 1 m, seen from above by one camera."""
    vertices, faces = plate(2.0, 1.0)
    camera = Camera(300, 200, 150.0, 150.0, 150.0, 100.0, look_at((1.0, 0.5, 2.0), (1.0, 0.5001, 0.0)))
    buffers = MeshRasterizer(vertices, faces).render(camera)
    view = TrueView("above", camera, buffers.depth, buffers.of_face(np.zeros(2, np.int16), missing=-1))
    return GroundTruth((view,), vertices, faces, np.zeros(2, np.int64), ("floor",))


def test_the_truth_scores_full_marks_and_a_lifted_copy_by_its_height(truth):
    perfect = mesh_score(truth.vertices, truth.faces, truth, rng())
    assert perfect.precision == perfect.recall == perfect.fscore == 1.0
    assert perfect.median_error_m < 1e-12
    lifted = mesh_score(truth.vertices + np.array([0, 0, 0.03]), truth.faces, truth, rng())
    assert lifted.fscore == 1.0 and lifted.median_error_m == pytest.approx(0.03)
    away = mesh_score(truth.vertices + np.array([0, 0, 0.06]), truth.faces, truth, rng())
    assert away.precision == away.recall == away.fscore == 0.0


def test_half_a_surface_loses_recall_and_a_false_one_precision(truth):
    half = mesh_score(*plate(1.0, 1.0), truth, rng())
    assert half.precision == 1.0
    assert half.recall == pytest.approx(1.05 / 2.0, abs=0.02)  # 5 cm beyond its rim count too
    assert half.fscore == pytest.approx(2 * half.recall / (1 + half.recall))
    false = trimesh.util.concatenate([trimesh.Trimesh(*plate(2.0, 1.0)), trimesh.Trimesh(*plate(2.0, 0.5, 0.5))])
    score = mesh_score(false.vertices, false.faces, truth, rng())
    assert score.recall == 1.0
    assert score.precision == pytest.approx(2 / 3, abs=0.01)


def test_scores_do_not_depend_on_the_frame(truth):
    turn = similarity(1.0, Rotation.from_rotvec((0.3, -0.8, 1.1)), (4.0, -1.0, 2.0))
    vertices, faces = plate(1.3, 1.0, 0.01)
    here = mesh_score(vertices, faces, truth, rng())
    there = mesh_score(vertices @ turn[:3, :3].T + turn[:3, 3], faces, truth.transformed(turn), rng())
    assert there.precision == pytest.approx(here.precision, abs=1e-3)
    assert there.recall == pytest.approx(here.recall, abs=0.01)  # voxels lie elsewhere
    assert there.median_error_m == pytest.approx(here.median_error_m, abs=1e-6)


# ---- aligned priors


@settings(max_examples=15, deadline=None)
@given(
    offset=st.tuples(*[st.floats(-0.1, 0.1)] * 3),
    angle=st.floats(0.0, 3.0),
    scale=st.floats(0.8, 1.25),
    seed=st.integers(0, 1000),
)
def test_the_errors_are_those_put_in(offset, angle, scale, seed):
    generator = np.random.default_rng(seed)
    box = trimesh.creation.box((0.5, 0.7, 1.1))
    box.apply_translation((3.0, 1.0, -2.0))  # far from the prior's own origin
    vertices, faces = np.asarray(box.vertices), np.asarray(box.faces)
    true = similarity(1.3, Rotation.random(random_state=seed), generator.normal(size=3))
    axis = generator.normal(size=3)
    axis /= np.linalg.norm(axis)
    centre = vertices.mean(axis=0) @ true[:3, :3].T + true[:3, 3]
    error = similarity(scale, Rotation.from_rotvec(angle * axis), (0, 0, 0))
    error[:3, 3] = centre - error[:3, :3] @ centre + offset  # about the centre, then away
    score = alignment_score(error @ true, true, vertices, faces, rng())
    assert score.translation_m == pytest.approx(np.linalg.norm(offset), abs=1e-9)
    assert score.rotation_deg == pytest.approx(np.degrees(angle), abs=1e-5)
    assert score.scale_percent == pytest.approx(100 * abs(scale - 1), abs=1e-9)


def turned_about_z(degrees, centre):
    return trimesh.transformations.rotation_matrix(np.radians(degrees), (0, 0, 1), centre)


def test_a_symmetric_prior_may_stand_any_of_its_ways():
    mesh = trimesh.creation.cylinder(0.3, 0.8, sections=4)
    mesh.apply_translation((2.0, 0.0, 0.4))
    true = similarity(0.9, Rotation.from_rotvec((0, 0, 0.4)), (1.0, 2.0, 0.0))
    symmetries = [turned_about_z(degrees, (2.0, 0.0, 0.0)) for degrees in (90, 180, 270)]
    estimated = true @ symmetries[2] @ turned_about_z(4.0, (2.0, 0.0, 0.0))
    blind = alignment_score(estimated, true, mesh.vertices, mesh.faces, rng())
    assert blind.rotation_deg == pytest.approx(86.0)
    score = alignment_score(estimated, true, mesh.vertices, mesh.faces, rng(), symmetries)
    assert score.rotation_deg == pytest.approx(4.0)
    assert score.translation_m == pytest.approx(0.0, abs=1e-9)
    assert score.chamfer_m == pytest.approx(blind.chamfer_m, abs=5e-4)
    for one in symmetries:
        turned = mesh.vertices @ one[:3, :3].T + one[:3, 3]
        assert Surface(mesh.vertices, mesh.faces, 100, rng()).distance(turned).max() < 1e-9


def test_the_chamfer_distance_of_parallel_plates_is_their_distance():
    same = chamfer_distance_m(plate(1.0, 1.0), plate(1.0, 1.0), rng())
    apart = chamfer_distance_m(plate(1.0, 1.0), plate(1.0, 1.0, 0.07), rng())
    assert same < 1e-12 and apart == pytest.approx(0.07)
    # One way all is near, the other way half of it is up to a metre off: (0 + 1/4) / 2.
    longer = chamfer_distance_m(plate(1.0, 1.0), plate(2.0, 1.0), rng())
    assert longer == pytest.approx(0.125, abs=0.008)
    assert chamfer_distance_m(plate(2.0, 1.0), plate(1.0, 1.0), rng()) == pytest.approx(longer, abs=0.01)


@pytest.mark.parametrize("linear", [np.diag([1.0, 1.0, 1.2]), np.diag([1.0, 1.0, -1.0]), np.zeros((3, 3))])
def test_what_is_no_similarity_is_refused(linear):
    wrong = np.eye(4)
    wrong[:3, :3] = linear
    vertices, faces = plate(1.0, 1.0)
    with pytest.raises(EvaluationError, match="no similarity"):
        alignment_score(wrong, np.eye(4), vertices, faces, rng())
