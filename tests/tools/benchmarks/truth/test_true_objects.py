"""The library and masks of a scene whose truth is known, as an artist would bring them."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest
import trimesh

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.evaluation.ground_truth import GroundTruth, TrueView
from r2sego_blender.geometry.objects.shapes import Shape, load_shape, mesh_files
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer
from tools.benchmarks.truth.true_objects import TrueObject, rough_masks, symmetries, true_objects, write_library

CHAIR = (
    ((-0.2, -0.2, 0.4), (0.2, 0.2, 0.45)),
    ((-0.2, 0.16, 0.45), (0.2, 0.2, 0.9)),
    ((-0.2, -0.2, 0.0), (-0.15, 0.2, 0.4)),
    ((0.15, -0.2, 0.0), (0.2, 0.2, 0.4)),
    ((-0.2, -0.15, 0.6), (-0.16, 0.16, 0.64)),
)


def boxes(parts: Sequence) -> trimesh.Trimesh:
    return trimesh.util.concatenate([trimesh.creation.box(bounds=part) for part in parts])


def things() -> dict[str, trimesh.Trimesh]:
    """Two chairs that are alike, a table, and what is no object for the library."""
    second = boxes(CHAIR)
    second.apply_transform(trimesh.transformations.rotation_matrix(2.1, (0, 0, 1)))
    second.apply_translation((1.2, 0.3, 0.0))
    table = boxes([((-0.5, 0.8, 0.0), (0.5, 1.2, 0.7))])
    return {
        "room": trimesh.creation.box(bounds=((-2.5, -2.5, 0.0), (2.5, 2.5, 2.5))),
        "chair": boxes(CHAIR),
        "chair_2": second,
        "table": table,
        "vase": boxes([((-0.1, 0.9, 0.7), (0.1, 1.1, 1.0))]),
        "carpet": boxes([((-1.5, -1.5, 0.0), (-0.5, -0.5, 0.01))]),
    }


@pytest.fixture(scope="module")
def truth() -> GroundTruth:
    meshes = list(things().values())
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    faces = np.concatenate([mesh.faces + at for mesh, at in zip(meshes, starts[:-1], strict=True)])
    instances = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
    views = []
    for index, x in enumerate((-1.0, 0.2, 1.1)):
        camera = Camera(160, 120, 110.0, 110.0, 80.0, 60.0, look_at((x, -2.0, 1.5), (0.3, 0.4, 0.4)))
        buffers = MeshRasterizer(vertices, faces).render(camera)
        ids = buffers.of_face(instances, missing=-1).astype(np.int16)
        views.append(TrueView(f"view{index}", camera, buffers.depth, ids))
    return GroundTruth(tuple(views), vertices, faces.astype(np.int32), instances, tuple(things()))


@pytest.fixture(scope="module")
def objects(truth) -> tuple[TrueObject, ...]:
    return true_objects(truth, np.random.default_rng(0))


def test_what_stands_on_the_floor_gets_a_frame_of_its_own(objects):
    assert [one.name for one in objects] == ["chair", "chair_2", "table"]
    for one in objects:
        mesh = things()[one.name]
        world = one.vertices @ one.world_from_own[:3, :3].T + one.world_from_own[:3, 3]
        corners = [np.sort(v[f].reshape(-1, 9), axis=0) for v, f in ((world, one.faces), (mesh.vertices, mesh.faces))]
        np.testing.assert_allclose(*corners, atol=1e-9)
        scale = np.cbrt(np.linalg.det(one.world_from_own[:3, :3]))
        assert 0.3 < scale < 3.4
        tilt = np.abs(one.world_from_own[:3, :3] / scale).max(1)
        assert (tilt < 0.9999).any()  # its axes are not the world's
    assert len({round(float(np.linalg.det(one.world_from_own[:3, :3])), 6) for one in objects}) == 3


def test_other_seeds_give_other_frames_of_the_same_objects(truth, objects):
    same, other = (true_objects(truth, np.random.default_rng(seed)) for seed in (0, 1))
    np.testing.assert_array_equal(same[0].vertices, objects[0].vertices)
    assert np.abs(other[0].vertices - objects[0].vertices).max() > 0.01


def test_twins_are_found_and_strangers_are_not(objects):
    chair, twin, table = objects
    pose = twin.pose_of(chair)
    world = chair.vertices @ pose[:3, :3].T + pose[:3, 3]
    truly = twin.vertices @ twin.world_from_own[:3, :3].T + twin.world_from_own[:3, 3]
    np.testing.assert_allclose(world, truly, atol=1e-6)
    assert chair.pose_of(table) is None and table.pose_of(chair) is None
    bent = replace(twin, vertices=twin.vertices * [1.0, 1.0, 1.02])
    assert bent.pose_of(chair) is None


@pytest.mark.parametrize(("size", "count"), [((1.0, 0.6, 0.3), 4), ((1.0, 0.5, 0.5), 8), ((1.0, 1.0, 1.0), 24)])
def test_symmetries_of_boxes(size, count):
    box = trimesh.creation.box(size)
    turn = trimesh.transformations.random_rotation_matrix(np.random.default_rng(3).random(3))
    turn[:3, 3] = (0.4, -2.0, 1.0)
    box.apply_transform(turn)
    found = symmetries(Shape.of("box", box.vertices, box.faces))
    assert len(found) == count
    for one in found:
        np.testing.assert_allclose(one[:3, :3] @ one[:3, :3].T, np.eye(3), atol=1e-9)
        moved = box.vertices @ one[:3, :3].T + one[:3, 3]
        apart = np.linalg.norm(moved[:, None] - box.vertices[None], axis=2).min(1)
        assert apart.max() < 1e-6


def test_a_chair_has_no_symmetry_but_itself(objects):
    (only,) = symmetries(Shape.of("chair", objects[0].vertices, objects[0].faces))
    np.testing.assert_allclose(only, np.eye(4), atol=1e-9)


def test_a_pose_is_scored_up_to_symmetries(objects):
    chair, _, table = objects
    rng = np.random.default_rng(0)
    turn = trimesh.transformations.rotation_matrix(np.pi, (0, 0, 1), (0.0, 1.0, 0.0))
    assert table.score(turn @ table.world_from_own, rng).rotation_deg < 0.01
    turn = trimesh.transformations.rotation_matrix(np.pi, (0, 0, 1))
    assert chair.score(turn @ chair.world_from_own, rng).rotation_deg == pytest.approx(180.0)
    shift = trimesh.transformations.translation_matrix((0.03, 0.0, 0.04))
    assert chair.score(shift @ chair.world_from_own, rng).translation_m == pytest.approx(0.05)


def test_masks_are_the_outlines_a_pixel_wider_or_narrower(truth, objects):
    found = rough_masks(truth, objects, np.random.default_rng(2))
    square, kinds = np.ones((3, 3), np.uint8), set()
    assert [one.name for one in found] == [one.name for one in objects]
    for one in found:
        assert list(one.masks) == [view.name for view in truth.views]
        for view in truth.views:
            outline = (view.ids == truth.names.index(one.name)).astype(np.uint8)
            wide, narrow = cv2.dilate(outline, square) > 0, cv2.erode(outline, square) > 0
            mask = one.masks[view.name]
            assert outline.sum() > 50 and (mask != (outline > 0)).any()
            kinds.add("wide" if np.array_equal(mask, wide) else "narrow" if np.array_equal(mask, narrow) else "else")
    assert kinds == {"wide", "narrow"}


def test_the_library_holds_the_objects_among_wrong_meshes(tmp_path, objects):
    other = trimesh.Scene()
    other.add_geometry(boxes(CHAIR[:3]), node_name="bench")
    other.add_geometry(trimesh.creation.icosphere(subdivisions=2), node_name="ball")
    other.add_geometry(trimesh.creation.box((0.9, 0.9, 0.001)), node_name="picture")
    other.add_geometry(trimesh.creation.box((0.1, 0.1, 0.1)), node_name="pebble")
    other.export(tmp_path / "other.glb")
    wrong = write_library(tmp_path / "library", objects, tmp_path / "other.glb", 5, np.random.default_rng(0))
    assert wrong == ["other_ball", "other_bench"]
    names = [path.stem for path in mesh_files(tmp_path / "library")]
    assert names == ["chair", "chair_2", *wrong, "table"]
    kept = load_shape(tmp_path / "library" / "table.ply")
    np.testing.assert_allclose(kept.vertices, objects[2].vertices, atol=1e-5)
    fewer = write_library(tmp_path / "fewer", objects[:1], tmp_path / "other.glb", 1, np.random.default_rng(0))
    assert len(fewer) == 1 and len(mesh_files(tmp_path / "fewer")) == 2
