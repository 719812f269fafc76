"""Fewer faces on the same surface."""

import numpy as np
import pytest
import trimesh

from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.mesh.decimation import decimated, welded
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer


def patches(count: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """A bent sheet of quads that share no vertex, as the proxy's envelope is."""
    x, y = np.meshgrid(np.arange(count), np.arange(count))
    low = np.stack([x.ravel(), y.ravel()], 1) / count
    corners = low[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) / count
    vertices = np.concatenate([corners, np.maximum(corners[..., :1] - 0.5, 0)], axis=2).reshape(-1, 3)
    quads = np.arange(4 * count**2).reshape(-1, 4)
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def test_patches_are_welded_and_flats_lose_their_faces():
    vertices, faces = decimated(*patches(), 40)
    assert len(faces) <= 40
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.area == pytest.approx(0.5 + 0.5 * np.sqrt(2), rel=0.02)
    assert mesh.body_count == 1
    assert (np.abs(vertices[:, 2] - np.maximum(vertices[:, 0] - 0.5, 0)) < 0.01).all()


def test_the_captures_see_the_same_depth(room):
    dense = room.mesh.copy().subdivide_to_size(0.08)
    vertices, faces = decimated(dense.vertices, dense.faces, 200)
    assert len(faces) <= 200 < len(dense.faces)
    rasterizer = MeshRasterizer(vertices, faces)
    for truth in room.depth_maps:
        depth = rasterizer.render(truth.camera).depth
        assert (np.abs(depth - truth.depth) < 0.005 * truth.depth).mean() > 0.995


def test_faces_keep_their_side():
    sphere = trimesh.creation.icosphere(4)
    vertices, faces = decimated(sphere.vertices, sphere.faces, 500)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(4 / 3 * np.pi, rel=0.03)


def test_a_small_mesh_stays_what_it_is():
    sphere = trimesh.creation.icosphere(2)
    vertices, faces = decimated(sphere.vertices, sphere.faces, 10_000)
    before = np.sort(np.asarray(sphere.triangles, np.float32).sum(1), axis=0)
    np.testing.assert_allclose(np.sort(vertices[faces].sum(1), axis=0), before, atol=1e-6)


@pytest.mark.parametrize(
    ("vertices", "faces", "wrong"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3), int), "no faces"),
        (np.zeros((3, 3)), [[0, 1, 2]], "no faces"),
        (np.full((3, 3), np.nan), [[0, 1, 2]], "not finite"),
        (np.eye(3), [[0, 1, 3]], "without vertices"),
        (np.eye(3), [[0, 1, -1]], "without vertices"),
    ],
)
def test_damaged_meshes_are_refused(vertices, faces, wrong):
    with pytest.raises(GeometryError, match=wrong):
        decimated(vertices, np.array(faces), 100)


def test_welding_twice_changes_nothing():
    once = welded(*patches(5))
    for a, b in zip(once, welded(*once), strict=True):
        np.testing.assert_array_equal(a, b)
