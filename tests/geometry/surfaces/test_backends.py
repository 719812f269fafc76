"""Surface backends: known shapes from exact depth, hostile clouds, and an absent NKSR."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from r2sego_blender.config.settings import ProxySettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError, MachineError, NativeError
from r2sego_blender.geometry.proxy.fusion import compose_proxy
from r2sego_blender.geometry.room.completed_depth import CompletedDepth, DepthSource
from r2sego_blender.geometry.room.planes import RoomPlanes
from r2sego_blender.geometry.surfaces.backends import surface_backend
from r2sego_blender.geometry.surfaces.oriented_points import OrientedPoints, WeightedDepth
from r2sego_blender.geometry.surfaces.poisson import _reconstruct, poisson_surface
from r2sego_blender.geometry.surfaces.tsdf import DistanceField
from r2sego_blender.workers.child import call_in_child
from r2sego_blender.workers.nksr import PYTHON_VARIABLE

EMBEDDED = ("tsdf", "poisson")
RADIUS_M = 0.5
VOXEL_M = 0.03
TOLERANCE_M = 0.02


def field(low, high) -> DistanceField:
    return DistanceField.covering(np.array(low, float), np.array(high, float), VOXEL_M, 0.09)


def sphere_views() -> list[WeightedDepth]:
    """A sphere at the origin from eight sides, its depth exact."""
    views = []
    for x in (-1.0, 1.0):
        for y in (-1.0, 1.0):
            for z in (-1.0, 1.0):
                camera = Camera(160, 160, 200.0, 200.0, 80.0, 80.0, look_at((x, y, z), (0, 0, 0)))
                rays = camera.rays()
                length = np.linalg.norm(rays, axis=-1)
                centre = camera.camera_from_world[:3, 3]
                along = rays @ centre / length
                inside = RADIUS_M**2 - (centre @ centre - along**2)
                near = (along - np.sqrt(np.maximum(inside, 0))) / length
                depth = np.where(inside > 0, near, 0).astype(np.float32)
                views.append(WeightedDepth(camera, depth, (depth > 0).astype(np.float32)))
    return views


def room_views(room) -> list[WeightedDepth]:
    return [WeightedDepth(d.camera, d.depth, np.ones_like(d.depth)) for d in room.depth_maps]


def normals(vertices, faces):
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


@pytest.mark.parametrize("name", EMBEDDED)
def test_a_sphere_is_found_whole_and_faces_outwards(name):
    vertices, faces = surface_backend(name).surface(sphere_views(), field([-0.7] * 3, [0.7] * 3))
    assert np.abs(np.linalg.norm(vertices, axis=1) - RADIUS_M).max() < TOLERANCE_M
    area = np.linalg.norm(normals(vertices, faces), axis=1).sum() / 2
    assert area == pytest.approx(4 * np.pi * RADIUS_M**2, rel=0.03)
    assert (np.einsum("ij,ij->i", normals(vertices, faces), vertices[faces].mean(1)) > 0).mean() > 0.99


@pytest.mark.parametrize("name", EMBEDDED)
def test_a_room_is_found_and_nothing_else(room, name):
    vertices, faces = surface_backend(name).surface(room_views(room), field([-2.1, -1.6, -0.1], [2.1, 1.6, 2.5]))
    distance = room.distance(vertices[faces].mean(1))
    assert np.quantile(distance, 0.98) < TOLERANCE_M
    seen = np.concatenate([d.camera.unproject(d.depth)[3:-3:7, 3:-3:7].reshape(-1, 3) for d in room.depth_maps])
    found = np.linalg.norm(seen[:, None] - vertices[None, ::3], axis=2).min(1)
    assert (found < 2 * VOXEL_M).mean() > 0.97
    towards = room.depth_maps[1].camera.centre - vertices[faces].mean(1)
    assert (np.einsum("ij,ij->i", normals(vertices, faces), towards) > 0).mean() > 0.9


def test_poisson_gives_the_same_bits_in_any_folder(elsewhere):
    cloud = OrientedPoints.of(sphere_views(), np.full(3, -0.7), np.full(3, 0.7), VOXEL_M, 0.09)
    first = poisson_surface(cloud, VOXEL_M)
    elsewhere()
    second = poisson_surface(cloud, VOXEL_M)
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a, b)


def test_the_surface_ends_where_the_points_end():
    """Half a sphere stays open."""
    cloud = OrientedPoints.of(sphere_views(), np.full(3, -0.7), np.full(3, 0.7), VOXEL_M, 0.09)
    upper = cloud.points[:, 2] > 0
    vertices, _ = poisson_surface(OrientedPoints(cloud.points[upper], cloud.normals[upper]), VOXEL_M)
    assert vertices[:, 2].min() > -3 * VOXEL_M
    assert np.abs(np.linalg.norm(vertices[vertices[:, 2] > 0.05], axis=1) - RADIUS_M).max() < TOLERANCE_M


def test_points_follow_the_evidence_where_views_disagree():
    """The same plane 4 cm off in a view of little weight hardly moves the points."""
    camera = Camera(80, 60, 60.0, 60.0, 40.0, 30.0, np.eye(4))
    sure, guess = np.full(camera.shape, 1.0, np.float32), np.full(camera.shape, 1.04, np.float32)
    views = [WeightedDepth(camera, sure, np.ones_like(sure)), WeightedDepth(camera, guess, 0.1 * np.ones_like(sure))]
    cloud = OrientedPoints.of(views, np.full(3, -2.0), np.full(3, 2.0), 0.02, 0.09)
    assert np.abs(cloud.points[:, 2] - 1.0).mean() < 0.012
    np.testing.assert_allclose(cloud.normals, np.broadcast_to([0, 0, -1.0], cloud.normals.shape), atol=1e-3)


def test_depth_edges_give_no_points():
    """Between a box and the wall behind it nothing is made up."""
    camera = Camera(80, 60, 60.0, 60.0, 40.0, 30.0, np.eye(4))
    depth = np.full(camera.shape, 2.0, np.float32)
    depth[20:40, 30:50] = 1.0
    cloud = OrientedPoints.of(
        [WeightedDepth(camera, depth, np.ones_like(depth))], np.full(3, -4.0), np.full(3, 4.0), 0.02, 0.09
    )
    assert np.minimum(np.abs(cloud.points[:, 2] - 1), np.abs(cloud.points[:, 2] - 2)).max() < 1e-6


def hostile_clouds():
    rng = np.random.default_rng(0)
    points, up = rng.uniform(-1, 1, (500, 3)), np.tile([0.0, 0.0, 1.0], (500, 1))
    broken = points.copy()
    broken[7, 1] = np.nan
    endless = up.copy()
    endless[3, 0] = np.inf
    line = np.outer(np.linspace(0, 1, 500), [1.0, 2.0, 3.0])
    return {
        "empty": (points[:0], up[:0]),
        "one point": (points[:1], up[:1]),
        "coincident": (np.ones((500, 3)), up),
        "a line": (line, up),
        "NaN": (broken, up),
        "infinite normal": (points, endless),
        "no normals": (points, np.zeros((500, 3))),
        "normals of another cloud": (points, up[:400]),
        "flat": (points[:, :2], up),
    }


@pytest.mark.parametrize("name", hostile_clouds())
def test_hostile_clouds_are_errors_and_end_nothing(name):
    with pytest.raises(GeometryError, match="no surface can come of this cloud"):
        poisson_surface(OrientedPoints(*hostile_clouds()[name]), VOXEL_M)


def test_a_native_end_is_an_error_and_not_ours(tmp_path):
    """An empty file ends the native code with a signal, and the child alone with it."""
    (tmp_path / "points.ply").touch()
    with pytest.raises(NativeError, match="ended without a result"):
        call_in_child(_reconstruct, {"folder": str(tmp_path), "depth": 5})


@pytest.mark.parametrize("name", EMBEDDED)
def test_views_that_see_nothing_give_no_surface(name):
    camera = Camera(40, 30, 30.0, 30.0, 20.0, 15.0, np.eye(4))
    blind = WeightedDepth(camera, np.zeros(camera.shape, np.float32), np.ones(camera.shape, np.float32))
    try:
        vertices, faces = surface_backend(name).surface([blind], field([-1] * 3, [1] * 3))
        assert vertices.shape == faces.shape == (0, 3)
    except GeometryError:
        pass


def test_a_proxy_comes_of_poisson_too(room):
    completed = [
        CompletedDepth(d.depth, np.full(d.depth.shape, DepthSource.OBSERVED, np.uint8), d.camera)
        for d in room.depth_maps
    ]
    nothing = RoomPlanes(np.zeros((0, 3)), np.zeros(0), np.zeros(0, int), np.zeros(0, bool))
    observed = OrientedPoints(np.zeros((0, 3)), np.zeros((0, 3)))
    settings = replace(ProxySettings(voxel_m=0.04), surface="poisson")
    proxy = compose_proxy(room.captures, completed, observed, nothing, (), settings)
    distance = room.distance(proxy.vertices[proxy.faces].mean(1).astype(float))
    assert np.quantile(distance, 0.97) < TOLERANCE_M
    assert (proxy.provenance == 0).mean() > 0.8


@pytest.mark.parametrize("python", ["", "/no/such/python", sys.executable])
def test_nksr_that_is_not_there_says_what_to_do(python, monkeypatch):
    monkeypatch.setenv(PYTHON_VARIABLE, python)
    with pytest.raises(MachineError, match=r"Install nksr .* --set proxy\.surface=tsdf"):
        surface_backend("nksr").surface(sphere_views(), field([-0.7] * 3, [0.7] * 3))
