"""Canonical frames of meshes, and what happens to meshes that are damaged."""

import numpy as np
import pytest
import trimesh
from furniture import FURNITURE, moved, random_similarity
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.objects import shapes
from r2sego_blender.geometry.objects.shapes import MESH_SUFFIXES, Shape, load_shape, mesh_files, require_library

TURNS = Rotation.create_group("O").as_matrix()
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def canonical(shape):
    return moved(shape.vertices, shape.canonical_from_own)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(FURNITURE)))
def test_the_canonical_frame_does_not_depend_on_the_own_frame(seed, name):
    """Up to a turn that takes axes to axes."""
    vertices, faces = FURNITURE[name]()
    similarity = random_similarity(np.random.default_rng(seed), scales=(1e-3, 1e3))
    first, second = Shape.of(name, vertices, faces), Shape.of(name, moved(vertices, similarity), faces)
    for shape in (first, second):
        low, high = canonical(shape).min(0), canonical(shape).max(0)
        assert np.linalg.norm(high - low) == pytest.approx(1.0)
        np.testing.assert_allclose(low + high, 0.0, atol=1e-9)
    apart = [np.abs(canonical(first) @ turn.T - canonical(second)).max() for turn in TURNS]
    assert min(apart) < 1e-6


@pytest.mark.parametrize("seed", range(4))
def test_the_axes_of_a_worn_and_turned_box_are_found(seed):
    """Its surface is rough: normals are off by degrees, the axes by less than one."""
    rng = np.random.default_rng(seed)
    box = trimesh.creation.box((1.0, 0.6, 0.3)).subdivide_to_size(0.08)
    turn = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    rough = box.vertices + rng.normal(size=box.vertices.shape) * 0.002
    shape = Shape.of("box", rough @ turn.T, box.faces)
    axes = shape.canonical_from_own[:3, :3]
    axes = axes / np.cbrt(np.linalg.det(axes))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)
    along = np.abs(axes @ turn).max(1)  # the cosine to the nearest of the box's own axes
    assert (along > np.cos(np.radians(1.0))).all()


def test_a_shape_that_looks_everywhere_keeps_its_own_axes_or_has_some():
    ball = trimesh.creation.icosphere(subdivisions=3)
    axes = Shape.of("ball", ball.vertices, ball.faces).canonical_from_own[:3, :3]
    axes = axes / np.cbrt(np.linalg.det(axes))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)


def test_the_mesh_is_kept_as_it_was_given():
    vertices, faces = FURNITURE["table"]()
    shape = Shape.of("table", vertices, faces)
    np.testing.assert_array_equal(shape.vertices, vertices)
    np.testing.assert_array_equal(shape.faces, faces)
    unused = Shape.of("table", np.concatenate([vertices, [[90.0, 0.0, 0.0]]]), faces)
    np.testing.assert_array_equal(unused.vertices, vertices)  # a stray vertex makes it no larger


def test_lighter_meshes_stay_within_their_detail():
    ball = trimesh.creation.icosphere(subdivisions=5)
    shape = Shape.of("ball", ball.vertices, ball.faces)
    counts = [len(faces) for _, faces in shape.drawn]
    assert counts == sorted(counts) and counts[0] < len(ball.faces) / 10
    radius = 0.5 / np.sqrt(3)  # in the canonical frame
    for (vertices, faces), detail in zip(shape.drawn, (1 / 20, 1 / 45, 1 / 400), strict=True):
        assert 0 <= faces.min() <= faces.max() < len(vertices)
        samples, _ = trimesh.sample.sample_surface(trimesh.Trimesh(vertices, faces), 2000, seed=0)
        assert np.abs(np.linalg.norm(samples, axis=1) - radius).max() < detail
        assert (np.ptp(samples, axis=0) > 2 * radius - 2 * detail).all()


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".off", ".ply", ".stl"])
def test_files_of_every_format_give_the_same_shape(tmp_path, suffix):
    vertices, faces = FURNITURE["stool"]()
    path = tmp_path / f"stool{suffix}"
    trimesh.Trimesh(vertices, faces, process=False).export(path)
    shape = load_shape(path)
    assert shape.name == "stool" and len(shape.faces) == len(faces)
    corners = np.sort(vertices[faces].reshape(-1, 9), axis=0)
    np.testing.assert_allclose(np.sort(shape.vertices[shape.faces].reshape(-1, 9), axis=0), corners, atol=1e-6)


def test_all_meshes_of_a_scene_are_one_shape(tmp_path):
    scene = trimesh.Scene()
    for index in range(3):
        box = trimesh.creation.box((1, 1, 1))
        scene.add_geometry(box, transform=trimesh.transformations.translation_matrix((2 * index, 0, 0)))
    scene.export(tmp_path / "row.glb")
    shape = load_shape(tmp_path / "row.glb")
    assert len(shape.faces) == 36
    np.testing.assert_allclose(np.sort(np.ptp(shape.vertices, axis=0)), [1, 1, 5], atol=1e-6)


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        ([[0, 0, 0], [1, 0, np.nan], [0, 1, 0]], [[0, 1, 2]]),
        ([[0, 0, 0], [1, 0, np.inf], [0, 1, 0]], [[0, 1, 2]]),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]]),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, -1, 2]]),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], []),
        ([], []),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 1]]),
    ],
    ids=["nan", "inf", "beyond", "negative", "faceless", "empty", "line", "degenerate"],
)
def test_damaged_meshes_are_errors_with_their_name(vertices, faces):
    with pytest.raises(GeometryError, match="sofa") as caught:
        Shape.of("sofa", np.array(vertices, float), np.array(faces, int))
    assert caught.value.cure


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("chair.obj", b"v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n"),
        ("chair.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"),
        ("chair.obj", TRIANGLE.encode()),
        ("chair.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"),
        ("chair.blend", b"BLENDER"),
        *((f"chair{suffix}", b"") for suffix in MESH_SUFFIXES),
        *((f"chair{suffix}", bytes(range(256)) * 3) for suffix in MESH_SUFFIXES),
    ],
)
def test_files_without_a_mesh_are_errors_that_name_them(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(GeometryError, match=name.replace(".", r"\.")) as caught:
        load_shape(tmp_path / name)
    assert caught.value.cure


def test_a_missing_file_is_an_error_that_names_it(tmp_path):
    with pytest.raises(GeometryError, match=r"nowhere\.glb"):
        load_shape(tmp_path / "nowhere.glb")


def test_the_mesh_files_of_a_folder_are_in_the_order_of_their_names(tmp_path):
    with pytest.raises(GeometryError, match="no such folder"):
        mesh_files(tmp_path / "library")
    with pytest.raises(GeometryError, match="holds no mesh") as caught:
        mesh_files(tmp_path)
    assert str(tmp_path) in str(caught.value)
    for name in ("b.glb", "a.OBJ", "c.ply", "readme.txt"):
        (tmp_path / name).touch()
    assert [path.name for path in mesh_files(tmp_path)] == ["a.OBJ", "b.glb", "c.ply"]


def test_a_folder_of_everything_is_no_library(tmp_path, monkeypatch):
    """A stranger's scene may name the root of the disk, all of which a refinement would digest."""
    monkeypatch.setattr(shapes, "_MOST_LIBRARY_FILES", 3)
    for name in ("a.glb", "b/c.glb", "b/d/e.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("mesh")
    require_library(tmp_path)
    (tmp_path / "b/f.glb").touch()
    with pytest.raises(GeometryError, match=tmp_path.name) as caught:
        require_library(tmp_path)
    assert caught.value.cure
