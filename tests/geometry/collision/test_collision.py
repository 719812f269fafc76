"""The collision surface in MuJoCo: it compiles where it is, and balls rest on it."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from progress_recorder import ProgressRecorder
from room_meshes import observed_proxy
from scipy.spatial import ConvexHull

from r2sego_blender.config.settings import CollisionSettings
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.collision.collision import collision_surface
from r2sego_blender.geometry.collision.collision_files import write_collision
from r2sego_blender.geometry.collision.convex import Limits, Soup, decompose
from r2sego_blender.geometry.proxy.proxy import Provenance

SETTINGS = CollisionSettings()


def as_proxy(mesh):
    return observed_proxy(mesh.vertices, mesh.faces)


@pytest.fixture(scope="module")
def furnished(room):
    """The room as reconstruction gives it: many small triangles with a little noise."""
    mesh = room.mesh.copy().subdivide_to_size(0.05)
    noise = np.random.default_rng(0).normal(size=mesh.vertices.shape) * 0.002
    inner = (np.abs(mesh.vertices) < (1.9, 1.4, 2.3)).all(1)
    mesh.vertices[inner] += noise[inner]
    return as_proxy(mesh)


@pytest.fixture(scope="module")
def surface(furnished):
    return collision_surface(furnished, SETTINGS)


@pytest.fixture(scope="module")
def model(surface, tmp_path_factory):
    folder = tmp_path_factory.mktemp("collision")
    write_collision(surface, folder)
    return mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))


def test_pieces_are_convex_solid_and_few(surface):
    assert 0 < len(surface.pieces) <= 300
    for vertices, faces in surface.pieces:
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        assert mesh.is_watertight
        hull = ConvexHull(vertices)
        assert mesh.volume == pytest.approx(hull.volume, rel=1e-6)
        assert mesh.volume > 1e-7


def test_compiled_vertices_are_where_ours_are(surface, model):
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for index, (vertices, _) in enumerate(surface.pieces):
        geom = model.geom(f"piece_{index:04d}").id
        mesh = model.geom_dataid[geom]
        start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        compiled = model.mesh_vert[start : start + count] @ data.geom_xmat[geom].reshape(3, 3).T
        compiled += data.geom_xpos[geom]
        ours = vertices[np.lexsort(np.round(vertices, 4).T)]
        theirs = compiled[np.lexsort(np.round(compiled, 4).T)]
        distance = np.linalg.norm(ours[:, None] - theirs[None], axis=2)
        assert distance.min(1).max() < 1e-3
        assert distance.min(0).max() < 1e-3


def test_balls_come_to_rest_on_the_surface(room, surface, model, tmp_path):
    """A grid of balls dropped over the whole room: floor and furniture alike."""
    radius = 0.03
    x, y = np.meshgrid(np.linspace(-1.85, 1.85, 12), np.linspace(-1.35, 1.35, 9))
    starts = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 1.1)])
    write_collision(surface, tmp_path)
    spec = mujoco.MjSpec.from_file(str(tmp_path / "scene.xml"))
    for index, start in enumerate(starts):
        body = spec.worldbody.add_body(name=f"ball {index}", pos=start)
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 0, 1), damping=0.02)
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(radius, 0, 0), mass=0.05, contype=2, conaffinity=1)
    scene = spec.compile()
    data = mujoco.MjData(scene)
    while data.time < 1.5:
        mujoco.mj_step(scene, data)
    heights = np.array([data.body(f"ball {i}").xpos[2] for i in range(len(starts))]) - radius
    on_box = (np.abs(starts[:, :2] - (0.9, 0.8)) < (0.5 - radius, 0.3 - radius)).all(1)
    beside = (np.abs(starts[:, :2] - (0.9, 0.8)) < (0.5 + 0.05, 0.3 + 0.05)).all(1) & ~on_box
    assert (heights > -0.01).all()
    assert on_box.sum() >= 3
    np.testing.assert_allclose(heights[on_box], 0.7, atol=0.02)
    np.testing.assert_allclose(heights[~on_box & ~beside], 0.0, atol=0.002)


def test_nothing_stands_out_into_the_room(room, surface):
    """No piece reaches farther into free space than its tolerance, but for cut corners."""
    rng = np.random.default_rng(1)
    points = rng.uniform(-1, 1, (4000, 3)) * (1.9, 1.4, 1.1) + (0, 0, 1.2)
    inside_box = (np.abs(points - (0.9, 0.8, 0.35)) < (0.5, 0.3, 0.35)).all(1)
    points = points[(room.distance(points) > 0.06) & ~inside_box]
    for vertices, _ in surface.pieces:
        planes = ConvexHull(vertices).equations
        assert not (points @ planes[:, :3].T + planes[:, 3] < 0).all(1).any()


def _grid(x, y, height):
    """A square mesh of 5 cm cells over the ranges ``x`` and ``y``, at ``height(x, y)``."""
    across, along = (np.linspace(*ends, round((ends[1] - ends[0]) / 0.05) + 1) for ends in (x, y))
    points = np.stack(np.meshgrid(across, along), -1).reshape(-1, 2)
    corner = (np.arange(len(along) - 1)[:, None] * len(across) + np.arange(len(across) - 1)).ravel()
    up = corner + len(across)
    faces = np.concatenate([np.stack(t, 1) for t in ((corner, corner + 1, up), (corner + 1, up + 1, up))])
    return trimesh.Trimesh(np.column_stack([points, height(*points.T)]), faces, process=False)


def test_low_bumps_that_nothing_observed_are_floor_and_what_stands_on_it_stays():
    """A floor with two bumps 6 cm high, one of them observed, and a completed wall of loose cells."""
    floor = _grid((-1.0, 1.0), (-1.0, 1.0), lambda x, y: 0.06 * (np.maximum(np.abs(np.abs(x) - 0.5), np.abs(y)) < 0.2))
    wall = _grid((-1.0, 1.0), (0.0, 0.5), lambda x, y: 0 * x)
    wall.vertices = wall.vertices[:, [0, 2, 1]] + (0.0, 1.0, 0.0)
    loose = trimesh.Trimesh(
        wall.vertices[wall.faces].reshape(-1, 3), np.arange(3 * len(wall.faces)).reshape(-1, 3), process=False
    )
    both = trimesh.util.concatenate([floor, loose])
    observed = np.abs(both.triangles_center - (0.5, 0.0, 0.0))[:, :2].max(1) < 0.25
    provenance = np.where(observed, Provenance.OBSERVED, Provenance.COMPLETED).astype(np.uint8)
    surface = collision_surface(replace(as_proxy(both), provenance=provenance), SETTINGS)

    def highest(x):
        over = [v for v, _ in surface.pieces if (v.min(0)[:2] < (x, 0)).all() and (v.max(0)[:2] > (x, 0)).all()]
        return max((v[:, 2].max() for v in over), default=0.0)

    assert highest(-0.5) == 0.0
    assert highest(0.5) == pytest.approx(0.06, abs=0.015)
    at_wall = [v for v, _ in surface.pieces if v[:, 1].min() > 0.9]
    assert np.ptp(np.concatenate(at_wall)[:, 0]) > 1.9
    assert all(v[:, 2].min() < 0.01 for v in at_wall if v[:, 2].max() < 0.4)  # no slit at its foot
    assert max(v[:, 2].max() for v in at_wall) > 0.48
    as_it_is = collision_surface(
        replace(as_proxy(both), provenance=provenance), replace(SETTINGS, completed_floor_m=0.0)
    )
    assert len(as_it_is.pieces) > len(surface.pieces)


def test_the_underside_of_a_fold_in_the_floor_is_no_slab_on_it():
    """A floor a centimetre high, half of which was reconstructed from below as well."""
    floor = _grid((-1.0, 1.0), (-1.0, 1.0), lambda x, y: 0 * x + 0.01)
    below = floor.faces[floor.triangles_center[:, 0] > 0.0][:, ::-1]
    folded = trimesh.Trimesh(floor.vertices, np.concatenate([floor.faces, below]), process=False)
    surface = collision_surface(as_proxy(folded), SETTINGS)
    assert not surface.pieces
    normals = trimesh.Trimesh(surface.vertices, surface.faces, process=False).face_normals
    assert len(normals) and (surface.vertices[:, 2] == 0.0).all() and (normals[:, 2] > 0.99).all()


def test_the_floor_is_one_flat_box_under_the_room(surface, model):
    floor = model.geom("floor")
    assert floor.type == mujoco.mjtGeom.mjGEOM_BOX
    assert floor.pos[2] + floor.size[2] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(np.abs(surface.floor[:, :2]).max(0), (2.0, 1.5), atol=0.02)
    assert not surface.floor[:, 2].any()


def test_files_are_all_in_the_world_frame(surface, tmp_path):
    write_collision(surface, tmp_path)
    low, high = surface.vertices.min(0), surface.vertices.max(0)
    for name in ("mesh.obj", "mesh.stl"):
        loaded = trimesh.load(tmp_path / name, force="mesh")
        np.testing.assert_allclose(loaded.bounds, [low, high], atol=1e-4)
    scene = trimesh.load(tmp_path / "mesh.glb", force="mesh")
    np.testing.assert_allclose(scene.bounds[1] - scene.bounds[0], (high - low)[[0, 2, 1]], atol=1e-4)
    assert len(list((tmp_path / "hulls").glob("*.obj"))) == len(surface.pieces)
    write_collision(surface, tmp_path)
    assert len(list((tmp_path / "hulls").glob("*.obj"))) == len(surface.pieces)


@pytest.mark.parametrize("thickness_m", [0.03, 0.08])
def test_a_piece_is_as_thick_as_is_set_behind_its_surface(thickness_m):
    wall = _grid((-1.0, 1.0), (1.0, 2.0), lambda x, y: 0 * x)
    wall.vertices = wall.vertices[:, [0, 2, 1]] + (0.0, 1.0, 0.0)  # its front looks to -y
    surface = collision_surface(as_proxy(wall), replace(SETTINGS, thickness_m=thickness_m))
    corners = np.concatenate([vertices for vertices, _ in surface.pieces])
    np.testing.assert_allclose((corners[:, 1].min(), corners[:, 1].max()), (1.0, 1.0 + thickness_m), atol=1e-6)


@pytest.mark.parametrize(("tolerance_m", "is_floor"), [(0.03, True), (0.015, False)])
def test_level_faces_within_the_tolerance_of_zero_are_the_floor(tolerance_m, is_floor):
    level = _grid((-1.0, 1.0), (-1.0, 1.0), lambda x, y: 0 * x + 0.02)
    surface = collision_surface(as_proxy(level), replace(SETTINGS, floor_tolerance_m=tolerance_m))
    assert (len(surface.floor), len(surface.pieces) > 0) == ((4, False) if is_floor else (0, True))


def _valley(steepness):
    """A gutter along y that faces up, a metre above the floor."""
    return _grid((-0.5, 0.5), (-0.5, 0.5), lambda x, y: 1.0 + steepness * np.abs(x))


def _fill_m(surface):
    """How high pieces stand in the middle of the gutter."""
    heights = [
        z
        for z in np.linspace(1.0, 1.3, 61)
        if any((ConvexHull(vertices).equations @ (0.0, 0.013, z, 1.0) <= 1e-6).all() for vertices, _ in surface.pieces)
    ]
    return max(heights) - 1.0


@pytest.mark.parametrize("carrying_m", [0.01, 0.15])
def test_what_carries_is_held_to_a_tolerance_of_its_own(carrying_m):
    limits = replace(SETTINGS, tolerance_m=0.2, cell_m=2.0, carrying_tolerance_m=carrying_m)
    filled_m = _fill_m(collision_surface(as_proxy(_valley(0.25)), limits))
    assert filled_m < 0.02 if carrying_m == 0.01 else filled_m > 0.1


def test_cutting_begins_with_cells_and_ends_with_small_ones():
    """The gutter's cells end in the middle of each side where they may; it never fits."""
    gutter = as_proxy(_valley(1.0))
    tight = replace(SETTINGS, tolerance_m=0.002, carrying_tolerance_m=0.002)
    coarse = collision_surface(gutter, replace(tight, cell_m=2.0, min_cell_m=1.0))
    assert len(coarse.pieces) == 1 and _fill_m(coarse) > 0.25
    assert _fill_m(collision_surface(gutter, replace(tight, cell_m=2.0, min_cell_m=0.06))) < 0.05
    assert len(collision_surface(gutter, replace(tight, cell_m=0.3, min_cell_m=1.0)).pieces) > 1


@pytest.mark.parametrize("cell_m", [0.1, 0.3])
def test_one_vertex_is_left_of_those_in_a_cell(cell_m):
    level = _grid((-1.0, 1.0), (-1.0, 1.0), lambda x, y: 0 * x + 1.0)
    vertices = collision_surface(as_proxy(level), replace(SETTINGS, simplification_m=cell_m)).vertices
    cells = np.unique(np.floor(level.vertices / cell_m + 0.5), axis=0)
    np.testing.assert_array_equal(np.unique(np.floor(vertices / cell_m + 0.5), axis=0), cells)
    assert len(vertices) == len(cells)


def test_loose_crumbs_are_dropped():
    crumb = trimesh.creation.box((0.06, 0.06, 0.06))
    crumb.apply_translation((0, 0, 1.2))
    with_crumb = trimesh.util.concatenate([_grid((-1.0, 1.0), (-1.0, 1.0), lambda x, y: 0 * x), crumb])
    for smallest_m, kept in ((0.15, False), (0.05, True)):  # it is 0.104 m across
        surface = collision_surface(as_proxy(with_crumb), replace(SETTINGS, min_component_m=smallest_m))
        assert (np.linalg.norm(surface.vertices - (0, 0, 1.2), axis=1) < 0.2).any() == kept


def test_the_number_of_pieces_is_bounded():
    bumps = trimesh.creation.icosphere(4, 1.0)
    rng = np.random.default_rng(0)
    bumps.vertices *= 1 + 0.15 * rng.normal(size=(len(bumps.vertices), 1))
    bumps.apply_translation((0, 0, 3))
    few, told = CollisionSettings(max_pieces=60), ProgressRecorder()
    surface = collision_surface(as_proxy(bumps), few, told)
    assert len(surface.pieces) <= 60
    assert surface.tolerance_m > few.tolerance_m
    (warning,) = told.warnings
    assert f"{100 * surface.tolerance_m:.1f} cm" in warning
    assert "more than 60 (collision.max_pieces)" in warning


def test_the_work_is_told_to_its_end(furnished, surface):
    told = ProgressRecorder()
    again = collision_surface(furnished, SETTINGS, told)
    assert len(again.pieces) == len(surface.pieces)
    assert told.warnings == []
    assert [task.title for task in told.tasks] == ["Cutting into convex pieces", "Joining flat pieces"]
    assert all(task.done == task.total > 0 for task in told.tasks)


def test_the_same_proxy_gives_the_same_files(furnished, surface, tmp_path):
    again = collision_surface(furnished, SETTINGS)
    texts = []
    for index, each in enumerate((surface, again)):
        write_collision(each, tmp_path / str(index))
        files = sorted(p for p in (tmp_path / str(index)).rglob("*") if p.is_file())
        texts.append([(p.name, p.read_bytes()) for p in files])
    assert texts[0] == texts[1]


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_pieces_cover_the_whole_surface(seed):
    """Every point of every triangle lies in or on some piece."""
    rng = np.random.default_rng(seed)
    mesh = trimesh.creation.icosphere(2, 1.0)
    mesh.vertices *= rng.uniform(0.5, 1.5, 3) * (1 + 0.1 * rng.normal(size=(len(mesh.vertices), 1)))
    soup = Soup.of(mesh.vertices, mesh.faces)
    pieces, _ = decompose(soup, Limits(0.8, 0.1, 0.03, 0.03, 0.05), 100_000)
    covered = np.zeros(len(soup.areas), bool)
    for vertices, _ in pieces:
        planes = ConvexHull(vertices).equations
        covered |= (soup.centroids @ planes[:, :3].T + planes[:, 3] < 1e-5).all(1)
    assert covered.mean() > 0.995


def test_a_proxy_without_surface_is_refused():
    nothing = observed_proxy(np.zeros((0, 3)), np.zeros((0, 3)))
    with pytest.raises(GeometryError):
        collision_surface(nothing, SETTINGS)
