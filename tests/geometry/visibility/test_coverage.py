"""Coverage of the proxy: which faces many views see, against rays that ask one by one."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.visibility.coverage import Coverage, count_seen, face_areas

LENS = Camera(160, 120, 90.0, 90.0, 80.0, 60.0, np.eye(4))


@pytest.fixture(scope="module")
def mesh(room):
    """The made-up room in faces of 50 cm at most."""
    vertices, faces = trimesh.remesh.subdivide_to_size(room.mesh.vertices, room.mesh.faces, 0.5)
    return trimesh.Trimesh(vertices, faces, process=False)


@pytest.fixture(scope="module")
def views():
    rng = np.random.default_rng(5)
    places = rng.uniform((-1.6, -1.2, 0.9), (0.2, 1.2, 1.9), (6, 3))
    return [LENS.at(look_at(place, rng.uniform((-1, -1, 0.2), (1.8, 1, 1.2)))) for place in places]


def seen_by_rays(mesh, camera) -> np.ndarray:
    """(F,) bool: the middles of faces that a ray from the camera meets first, on their free side."""
    middles, normals = mesh.triangles_center, mesh.face_normals
    pixels, depth = camera.project(middles)
    seen = camera.sees(pixels, depth) & (((camera.centre - middles) * normals).sum(1) > 0)
    asked = np.flatnonzero(seen)
    seen[asked] = [not hidden(mesh.triangles, camera.centre, middle) for middle in middles[asked]]
    return seen


def hidden(triangles, start, end) -> bool:
    """Whether a triangle (F, 3, 3) crosses the segment well before its end (Moeller and Trumbore)."""
    a, along, aside = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    direction = end - start
    p = np.cross(direction, aside)
    inverse = 1.0 / np.where(np.abs(det := (along * p).sum(1)) > 1e-12, det, np.inf)
    q = np.cross(start - a, along)
    u, v, t = ((start - a) * p).sum(1) * inverse, q @ direction * inverse, (aside * q).sum(1) * inverse
    return bool(((inverse != 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 0.995)).any())


def test_the_faces_that_rays_meet_are_counted(mesh, views):
    counted = count_seen(mesh.vertices, mesh.faces, views)
    exact = np.sum([seen_by_rays(mesh, view) for view in views], axis=0)
    assert exact.max() > 2
    # A pixel may show a face whose middle is hidden or outside.
    assert (counted >= exact).mean() > 0.98 and (counted == exact).mean() > 0.7


def test_the_count_is_a_sum_over_views_and_ignores_the_faces_order(mesh, views):
    whole = count_seen(mesh.vertices, mesh.faces, views)
    parts = sum(count_seen(mesh.vertices, mesh.faces, [view]) for view in views)
    np.testing.assert_array_equal(whole, parts)
    order = np.random.default_rng(1).permutation(len(mesh.faces))
    shuffled = count_seen(mesh.vertices, mesh.faces[order], views)
    assert (shuffled != whole[order]).mean() < 0.01  # equal depths at an edge may fall to either face


def test_a_face_seen_from_behind_or_hidden_is_not_counted():
    wall = np.array([[-1, -1, 2], [1, -1, 2], [1, 1, 2], [-1, 1, 2.0]])
    faces = np.array([[0, 2, 1], [0, 3, 2]])  # turned to the camera at the origin
    assert (count_seen(wall, faces, [LENS]) == 1).all()
    assert (count_seen(wall, faces[:, ::-1], [LENS]) == 0).all()
    both = np.concatenate([wall, wall * (1, 1, 0.5)])
    nearer = np.concatenate([faces, faces[:, ::-1] + 4])  # hides the wall though seen from behind
    assert count_seen(both, nearer, [LENS]).tolist() == [0, 0, 0, 0]


def test_no_views_and_broken_meshes():
    wall = np.array([[-1, -1, 2], [1, -1, 2], [1, 1, 2.0]])
    assert count_seen(wall, [[0, 2, 1]], []).tolist() == [0]
    with pytest.raises(GeometryError, match="without vertices"):
        count_seen(wall, [[0, 2, 7]], [LENS])
    with pytest.raises(GeometryError, match="not finite"):
        count_seen(wall * np.nan, [[0, 2, 1]], [LENS])


def test_areas_are_told_by_what_sees_them(tmp_path):
    vertices = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0], [2, 1, 0.0]])
    areas = face_areas(vertices, np.array([[0, 1, 2], [1, 3, 2], [0, 2, 1], [1, 2, 3]]))
    np.testing.assert_allclose(areas, 1.0)
    coverage = Coverage(np.array([3, 1, 2, 0], np.uint32), np.array([0, 1, 2, 5], np.uint16), areas, 4)
    coverage.save(tmp_path / "coverage.npz")
    read = Coverage.load(tmp_path / "coverage.npz")
    assert read.views == 4
    assert read.areas_m2() == {"proxy": 4.0, "supported": 3.0, "seen": 3.0, "gap": 1.0, "weak": 1.0, "covered": 1.0}
    replace(coverage, seen=coverage.seen[:, None]).save(tmp_path / "coverage.npz")
    with pytest.raises(GeometryError, match="no coverage"):
        Coverage.load(tmp_path / "coverage.npz")
    (tmp_path / "coverage.npz").write_bytes(b"PK no")
    with pytest.raises(GeometryError, match="no coverage"):
        Coverage.load(tmp_path / "coverage.npz")
