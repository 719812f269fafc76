"""Priors of declared objects: what was decided, with its figures, and how it is kept."""

import dataclasses
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from furniture import FURNITURE, boxes, cameras_around, moved, observed_object, random_similarity, standing
from progress_recorder import ProgressRecorder
from scipy.spatial import cKDTree

from r2sego_blender.captures.capture import Capture
from r2sego_blender.config.settings import PriorSettings
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.objects.objects import DeclaredObject, Placement
from r2sego_blender.geometry.objects.prior_files import AlignedPrior, ObjectPrior, load_priors, read_record, save_priors
from r2sego_blender.geometry.objects.priors import (
    NEARER_THAN_ANYTHING_M,
    align_objects,
    gather_evidence,
    library_files,
    load_library,
)
from r2sego_blender.geometry.objects.shapes import Shape
from r2sego_blender.geometry.stereo.observed_geometry import ObservedGeometry

WORLD_FROM_CHAIR = standing(20.0, (0.1, 0.3))


@pytest.fixture(scope="module")
def own_from_chair() -> np.ndarray:
    return random_similarity(np.random.default_rng(4))


@pytest.fixture(scope="module")
def chair_file(tmp_path_factory, own_from_chair) -> Path:
    vertices, faces = FURNITURE["chair"]()
    path = tmp_path_factory.mktemp("mesh") / "chair.ply"
    trimesh.Trimesh(moved(vertices, own_from_chair), faces, process=False).export(path)
    return path


@pytest.fixture(scope="module")
def scene() -> SimpleNamespace:
    """Three captures of the chair, with the points they observed on it and elsewhere."""
    vertices, faces = FURNITURE["chair"]()
    cameras = cameras_around((0.1, 0.3, 0.5), count=3, width=240)
    return scene_of(moved(vertices, WORLD_FROM_CHAIR), faces, cameras, 900)


def scene_of(vertices, faces, cameras, count) -> SimpleNamespace:
    """What three ``cameras`` know of an object, ``count`` points on it among it."""
    seen = observed_object(vertices, faces, cameras, np.random.default_rng(9), count=count)
    views = zip(cameras, seen.depths, seen.masks, strict=True)
    behind = np.concatenate([camera.unproject(depth)[~mask][::200] for camera, depth, mask in views])
    points = np.concatenate([seen.points, behind]).astype(np.float32)
    visibility = np.zeros((len(points), 3), bool)
    for k, (camera, depth) in enumerate(zip(cameras, seen.depths, strict=True)):
        pixels, z = camera.project(points)
        inside = camera.sees(pixels, z)
        columns, rows = np.where(inside[:, None], pixels, 0).astype(int).T
        visibility[:, k] = inside & (np.abs(depth[rows, columns] - z) < 0.03)
    observed = ObservedGeometry(
        points, np.zeros_like(points), np.zeros_like(points), visibility, np.ones(len(points), np.float32)
    )
    return SimpleNamespace(
        captures=[Capture(name, Path(f"{name}.jpg"), c) for name, c in zip("abc", cameras, strict=True)],
        masks=dict(zip("abc", seen.masks, strict=True)),
        depths=seen.depths,
        observed=observed,
        on_chair=len(seen.points),
        bounds=seen.bounds,
    )


def aligned(scene, objects, library=(), settings=PriorSettings()):
    return align_objects(
        objects, library, scene.captures, scene.observed, scene.depths, scene.depths, scene.bounds, settings
    )


@pytest.fixture(scope="module")
def placed(scene, own_from_chair, chair_file) -> ObjectPrior:
    """The chair held where it truly stands."""
    pose = WORLD_FROM_CHAIR @ np.linalg.inv(own_from_chair)
    (found,) = aligned(scene, [DeclaredObject("seat", scene.masks, chair_file, Placement(pose, locked=True))])
    return found


def test_a_mesh_of_its_own_is_aligned(scene, chair_file):
    (found,) = aligned(scene, [DeclaredObject("seat", scene.masks, chair_file)])
    truth = moved(FURNITURE["chair"]()[0], WORLD_FROM_CHAIR)
    assert found.refusal == "" and found.record["shape"] == "chair"
    assert np.linalg.norm(found.prior.vertices - truth, axis=1).max() < 0.03
    assert found.record["silhouette_iou"] > 0.9
    json.dumps(found.record, allow_nan=False)


def test_a_locked_placement_is_kept_exactly(placed, own_from_chair):
    pose = WORLD_FROM_CHAIR @ np.linalg.inv(own_from_chair)
    np.testing.assert_allclose(placed.record["world_from_own"], pose, atol=1e-12)
    truth = moved(FURNITURE["chair"]()[0], WORLD_FROM_CHAIR)
    np.testing.assert_allclose(placed.prior.vertices, truth, atol=1e-5)  # of a PLY in float32
    assert placed.name == placed.prior.name == "seat"
    assert placed.record["energy"] < 0.2 and placed.record["observed_points"] > 300


def test_a_locked_placement_is_kept_where_it_explains_nothing(scene, chair_file):
    held = Placement(standing(0.0, (-1.5, -1.0), 0.7), locked=True)
    (found,) = aligned(scene, [DeclaredObject("seat", scene.masks, chair_file, held)])
    np.testing.assert_allclose(found.record["world_from_own"], held.world_from_own, atol=1e-12)
    assert found.prior is not None and found.record["silhouette_iou"] < 0.1


def test_objects_without_a_shape_or_a_mask_or_points_say_so(scene, chair_file):
    nothing = {name: np.zeros_like(mask) for name, mask in scene.masks.items()}
    pose = Placement(np.eye(4), locked=True)
    meshless, hidden, damaged = aligned(
        scene,
        [
            DeclaredObject("meshless", scene.masks, placement=pose),
            DeclaredObject("hidden", nothing, chair_file),
            DeclaredObject("damaged", scene.masks, chair_file.with_name("gone.ply")),
        ],
    )
    assert meshless.refusal == "there is no mesh for it and no library"
    assert hidden.refusal == "no mask shows the object"
    assert "cannot be read" in damaged.refusal
    for found in (meshless, hidden, damaged):
        assert found.prior is None
        assert found.record["name"] == found.name and found.record["refusal"] == found.refusal


def test_an_object_hardly_observed_is_not_tried(scene):
    lamp = Shape.of("lamp", *FURNITURE["lamp"]())
    (found,) = aligned(scene, [DeclaredObject("seat", scene.masks)], [lamp], PriorSettings(min_points=10**5))
    assert found.prior is None and "100000 are needed" in found.refusal
    assert set(found.record) == {"name", "refusal", "observed_points"}


def test_a_refused_shape_leaves_its_figures_and_no_prior(scene):
    lamp = Shape.of("lamp", *FURNITURE["lamp"]())
    (found,) = aligned(scene, [DeclaredObject("seat", scene.masks)], [lamp], PriorSettings(max_energy=0.01))
    assert found.prior is None and "above 0.01" in found.refusal
    assert found.record["shape"] == "lamp" and found.record["energy"] > 0.3


def test_symmetry_completes_what_no_mesh_fits_only_if_asked():
    """Three captures see two sides of a crate and its top."""
    vertices, faces = boxes(((-0.35, -0.28, 0), (0.35, 0.28, 0.6)))
    vertices = moved(vertices, standing(42.0, (0.1, 0.3)))
    scene = scene_of(vertices, faces, cameras_around((0.1, 0.3, 0.3), count=7, width=240)[2:5], 3000)
    one = DeclaredObject("crate", scene.masks)
    asked = PriorSettings(symmetry="unmatched")
    (refused,) = aligned(scene, [one])
    (found,) = aligned(scene, [one], settings=asked)
    (rejected,) = aligned(scene, [dataclasses.replace(one, decision="reject")], settings=asked)
    assert rejected.prior is None and rejected.record == refused.record
    assert refused.prior is None and refused.record.keys() == {"name", "refusal"}
    record = found.record
    assert record["backend"] == "symmetry" and record["no_mesh"] == refused.refusal
    assert "shape" not in record and record["energy"] <= asked.max_mirror_energy
    assert len(record["mirror_planes"]) == 2
    true = trimesh.sample.sample_surface(trimesh.Trimesh(vertices, faces), 20_000, seed=0)[0]
    assert (cKDTree(true).query(found.prior.vertices)[0] < 0.05).mean() > 0.95
    json.dumps(record, allow_nan=False)


def test_a_mesh_that_fits_is_not_replaced_by_symmetry(scene, chair_file):
    one = DeclaredObject("seat", scene.masks, chair_file)
    (found,) = aligned(scene, [one], settings=PriorSettings(symmetry="unmatched"))
    assert found.record["backend"] == "mesh" and found.record["shape"] == "chair"


def test_evidence_is_the_points_within_most_masks(scene):
    one = DeclaredObject("seat", scene.masks)
    anything = list(scene.masks.values())
    evidence = gather_evidence(one, scene.captures, scene.observed, scene.depths, scene.depths, anything, scene.bounds)
    truth = trimesh.Trimesh(moved(FURNITURE["chair"]()[0], WORLD_FROM_CHAIR), FURNITURE["chair"]()[1])
    assert 0.7 * scene.on_chair < len(evidence.points) <= scene.on_chair * 1.05
    low, high = truth.bounds
    assert ((evidence.points > low - 0.05) & (evidence.points < high + 0.05)).all(1).mean() > 0.97


def test_what_another_object_may_hide_is_nearer_than_anything(scene):
    """Beside the mask, where another object is declared, only reliable stereo says how far."""
    mask, depth = scene.masks["b"], scene.depths[1]
    other = np.zeros_like(mask)
    other[:, : mask.shape[1] // 2] = True
    stereo = np.where(np.arange(len(mask))[:, None] % 2, depth, np.float32(0))
    filled = np.full_like(mask, 7.0, np.float32)
    one = DeclaredObject("seat", {"b": mask})
    lists = ([np.zeros_like(image), image, np.zeros_like(image)] for image in (stereo, filled, other | mask))
    evidence = gather_evidence(one, scene.captures, scene.observed, *lists, scene.bounds)
    views = evidence.views[-1]
    camera = scene.captures[1].camera
    left, top = round(camera.cx - views.lenses[0, 2]), round(camera.cy - views.lenses[0, 3])
    window = np.s_[top : top + views.sizes[0, 0], left : left + views.sizes[0, 1]]
    expected = np.where(stereo > 0, stereo, np.where(other & ~mask, np.float32(NEARER_THAN_ANYTHING_M), filled))
    np.testing.assert_array_equal(views.depths.reshape(views.sizes[0]), expected[window])
    assert set(np.unique(np.where(stereo > 0, 0, expected)[window])) >= {np.float32(0.01), np.float32(7.0)}


def test_priors_and_their_record_are_read_back(tmp_path, placed):
    refused = ObjectPrior("lamp", None, "why not", {"name": "lamp", "refusal": "why not"})
    save_priors(tmp_path, [refused, placed])
    (found,) = load_priors(tmp_path)
    assert found.name == "seat"
    np.testing.assert_array_equal(found.vertices, placed.prior.vertices)
    np.testing.assert_array_equal(found.faces, placed.prior.faces)
    assert read_record(tmp_path) == [refused.record, placed.record]


def test_no_objects_leave_an_empty_record(tmp_path, scene):
    save_priors(tmp_path, aligned(scene, []))
    assert load_priors(tmp_path) == () and read_record(tmp_path) == []


@pytest.mark.parametrize("content", [None, b"", b"[{", b"\xff\xfe", b"3", b'["a"]', b'[{"name": 3, "refusal": ""}]'])
def test_a_damaged_record_is_an_error_that_names_it(tmp_path, content):
    if content is not None:
        (tmp_path / "priors.json").write_bytes(content)
    with pytest.raises(GeometryError, match=r"priors\.json") as caught:
        read_record(tmp_path)
    assert caught.value.cure


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"nothing"])
def test_a_damaged_prior_is_an_error_that_names_it(tmp_path, content):
    prior = AlignedPrior("seat", np.eye(3), np.array([[0, 1, 2]]))
    save_priors(tmp_path, [ObjectPrior("seat", prior, "", {})])
    (tmp_path / "seat.npz").write_bytes(content)
    with pytest.raises(GeometryError, match=r"seat\.npz"):
        load_priors(tmp_path)


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (np.full((3, 3), np.nan), [[0, 1, 2]]),
        (np.eye(3), [[0, 1, 3]]),
        (np.eye(3), [[0, 1, -1]]),
        (np.eye(3), [[0.0, 1.0, 2.0]]),
        (np.eye(4), [[0, 1, 2]]),
    ],
)
def test_a_prior_of_a_stranger_has_finite_vertices_and_their_faces(tmp_path, vertices, faces):
    np.savez(tmp_path / "seat.npz", vertices=vertices, faces=np.array(faces))
    with pytest.raises(GeometryError, match=r"seat\.npz"):
        load_priors(tmp_path)


def test_a_library_leaves_out_what_cannot_be_read(tmp_path):
    for name in ("table", "chair"):
        vertices, faces = FURNITURE[name]()
        trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / f"{name}.ply")
    (tmp_path / "broken.glb").write_bytes(b"glTF")
    told = ProgressRecorder()
    assert [shape.name for shape in load_library(tmp_path, told)] == ["chair", "table"]
    ((level, text),) = told.messages
    assert level == "warning" and "broken.glb" in text


def test_meshes_of_one_name_in_two_formats_are_told_apart(scene, tmp_path):
    """The worse of the two, read first, once got the other's pose."""
    for name, file in (("table", "seat.obj"), ("chair", "seat.ply"), ("lamp", "lamp.ply")):
        trimesh.Trimesh(*FURNITURE[name](), process=False).export(tmp_path / file)
    library = load_library(tmp_path)
    assert [shape.name for shape in library] == list(library_files(tmp_path))
    assert [shape.name for shape in library] == ["lamp", "seat.obj", "seat.ply"]
    (found,) = aligned(scene, [DeclaredObject("seat", scene.masks)], library)
    assert found.record["shape"] == "seat.ply"
    assert sorted(found.record["rough"]) == ["lamp", "seat.obj", "seat.ply"]
    truth = moved(FURNITURE["chair"]()[0], WORLD_FROM_CHAIR)
    assert np.linalg.norm(found.prior.vertices - truth, axis=1).max() < 0.03


def test_a_person_overrules_the_figures(scene, chair_file, own_from_chair, tmp_path):
    pose = WORLD_FROM_CHAIR @ np.linalg.inv(own_from_chair)
    strict = PriorSettings(max_energy=0.0)
    seat = DeclaredObject("seat", scene.masks, chair_file, Placement(pose, locked=False))
    (refused,) = aligned(scene, [seat], settings=strict)
    (accepted,) = aligned(scene, [dataclasses.replace(seat, decision="accept")], settings=strict)
    held = dataclasses.replace(seat, placement=Placement(pose, locked=True), decision="reject")
    (rejected,) = aligned(scene, [held], settings=PriorSettings(symmetry="unmatched"))
    assert refused.prior is None and refused.refused.name == "seat"
    assert accepted.prior is not None and accepted.record["accepted_despite"] == refused.refusal
    np.testing.assert_array_equal(accepted.prior.vertices, refused.refused.vertices)
    assert rejected.prior is None and "person" in rejected.refusal
    assert rejected.record["silhouette_iou"] > 0.9  # its figures are told all the same
    save_priors(tmp_path, [rejected])
    assert load_priors(tmp_path) == ()
    assert load_priors(tmp_path / "refused")[0].name == "seat"
