"""CoACD by regions: pieces cover the surface, the regions all of it; failures are named and mended."""

import numpy as np
import pytest
import trimesh
from progress_recorder import ProgressRecorder
from room_meshes import observed_proxy

from r2sego_blender.config.settings import CollisionSettings
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.collision import coacd_regions
from r2sego_blender.geometry.collision.coacd_regions import Region, decompose_by_coacd, regions
from r2sego_blender.geometry.collision.collision import collision_surface
from r2sego_blender.geometry.collision.convex import Limits, convex_hull
from r2sego_blender.workers.child import call_in_child

LIMITS = Limits(0.4, 0.06, 0.02, 0.01, 0.05)


@pytest.fixture(scope="module")
def angle() -> trimesh.Trimesh:
    """Two thick slabs that meet at a right angle: L-shaped, so not convex, in one object."""
    lower = trimesh.creation.box((0.6, 0.3, 0.1))
    upper = trimesh.creation.box((0.1, 0.3, 0.5))
    upper.apply_translation((-0.25, 0, 0.3))
    corner = np.array([[-0.3, -0.05], [0.3, -0.05], [0.3, 0.05], [-0.2, 0.05], [-0.2, 0.55], [-0.3, 0.55]])
    mesh = trimesh.creation.extrude_triangulation(corner, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]), 0.3)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0)))
    mesh.apply_translation((2.0, 1.0, 0.5))
    assert mesh.is_watertight and mesh.volume == pytest.approx(lower.volume + upper.volume)
    return mesh.subdivide_to_size(0.06)


def covered(points, pieces, reach):
    inside = np.zeros(len(points), bool)
    for vertices, faces in pieces:
        a, b, c = np.moveaxis(vertices[faces], 1, 0)
        normals = np.cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        inside |= ((points[:, None] - a) * normals).sum(2).max(1) <= reach
    return inside


def test_regions_are_the_components_and_cells_of_large_ones_and_hold_every_face():
    small = trimesh.creation.icosphere(2, 0.3)
    small.apply_translation((5, 0, 0.3))
    wall = trimesh.creation.box((3, 0.2, 2)).subdivide_to_size(0.2)
    mesh = trimesh.util.concatenate([small, wall])
    found = list(regions(np.asarray(mesh.vertices), np.asarray(mesh.faces), 1.0))
    assert sum(len(region.faces) for region in found) == len(mesh.faces)
    assert len({region.name for region in found}) == len(found)
    assert [len(r.faces) for r in found if r.name.startswith("object")] == [len(small.faces)]
    for region in found:
        assert np.ptp(region.vertices, axis=0).max() < 1.0 + 2 * 0.2 + 1e-9
        assert sorted(np.unique(region.faces)) == list(range(len(region.vertices)))
    areas = sum(trimesh.Trimesh(r.vertices, r.faces, process=False).area for r in found)
    assert areas == pytest.approx(mesh.area)


@pytest.mark.slow
def test_pieces_cover_an_angle_and_leave_its_inner_side_free(angle):
    pieces = decompose_by_coacd(np.asarray(angle.vertices), np.asarray(angle.faces), 1.0, LIMITS, 100)
    assert 2 <= len(pieces) <= 16
    for vertices, faces in pieces:
        solid = trimesh.Trimesh(vertices, faces, process=False)
        assert solid.is_watertight and solid.volume == pytest.approx(solid.convex_hull.volume, rel=1e-6)
    points = np.asarray(angle.triangles_center)
    assert covered(points, pieces, 0.01).mean() > 0.99
    inner = np.array([[2.0, 0.85, 0.7], [1.9, 0.85, 0.8], [1.85, 0.9, 0.7]])
    assert covered(inner, [convex_hull(points)], 0.0).all()
    assert not covered(inner, pieces, 0.0).any()


def test_what_is_convex_already_is_one_piece_without_coacd():
    box = trimesh.creation.box((0.5, 0.4, 0.3)).subdivide_to_size(0.1)
    (piece,) = decompose_by_coacd(np.asarray(box.vertices), np.asarray(box.faces), 1.0, LIMITS, 100)
    np.testing.assert_allclose(np.ptp(piece[0], axis=0), (0.5, 0.4, 0.3), atol=0.011)


def test_the_setting_chooses_coacd():
    """A box on a floor: the floor stays a rectangle, the box is a piece that nothing bounds."""
    floor = trimesh.creation.box((3, 3, 0.1))
    floor.apply_translation((0, 0, -0.05))
    box = trimesh.creation.box((0.5, 0.4, 0.3))
    box.apply_translation((0, 0, 0.25))
    mesh = trimesh.util.concatenate([floor, box]).subdivide_to_size(0.1)
    proxy = observed_proxy(mesh.vertices, mesh.faces)
    surface = collision_surface(proxy, CollisionSettings(decomposition="coacd"))
    assert len(surface.floor) == 4 and len(surface.pieces) == 1 and np.isinf(surface.tolerance_m)


def test_a_region_out_of_time_is_cut_into_planes_and_named(angle):
    recorder = ProgressRecorder()
    pieces = decompose_by_coacd(
        np.asarray(angle.vertices), np.asarray(angle.faces), 1.0, LIMITS, 100, timeout_s=0.05, progress=recorder
    )
    ((level, text),) = recorder.messages
    assert level == "warning" and "object 0" in text and "longer" in text
    assert covered(np.asarray(angle.triangles_center), pieces, 1e-5).mean() > 0.99


@pytest.mark.parametrize(
    "faces, words", [([[0, 1, 900000]], "not there"), (np.zeros((0, 3)), "no faces")], ids=["index", "empty"]
)
def test_what_would_end_coacd_is_refused_in_the_child(tmp_path, faces, words):
    """CoACD reads memory that is not its own for the first, and aborts for the second."""
    region = tmp_path / "region.npz"
    np.savez(region, vertices=np.eye(3), faces=np.asarray(faces, int))
    with pytest.raises(GeometryError, match=words):
        call_in_child(coacd_regions.cut, {"region": str(region), "pieces": str(tmp_path / "pieces.npz")}, timeout_s=60)


@pytest.mark.parametrize("vertices, faces", [(np.full((3, 3), np.nan), [[0, 1, 2]]), (np.eye(3), [[0, 1, 3]])])
def test_damaged_surfaces_are_refused_before(vertices, faces):
    with pytest.raises(GeometryError, match="not there"):
        decompose_by_coacd(vertices, np.array(faces), 1.0, LIMITS, 100)


def test_nothing_gives_nothing():
    assert decompose_by_coacd(np.zeros((0, 3)), np.zeros((0, 3), int), 1.0, LIMITS, 100) == []
    assert isinstance(next(regions(np.eye(3), np.array([[0, 1, 2]]), 2.0)), Region)
