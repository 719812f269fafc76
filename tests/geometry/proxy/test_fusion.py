"""The geometry proxy of a room whose true surfaces are known."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from r2sego_blender.config.settings import ProxySettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.proxy.fusion import AlignedPrior, compose_proxy
from r2sego_blender.geometry.proxy.proxy import Provenance
from r2sego_blender.geometry.room.completed_depth import CompletedDepth, DepthSource
from r2sego_blender.geometry.room.planes import RoomPlanes, find_planes
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

SETTINGS = ProxySettings(voxel_m=0.04)
VOXEL_M = SETTINGS.voxel_m


@pytest.fixture(scope="module")
def observed(observed_points):
    points, normals = observed_points(noise_m=0.002)
    return SimpleNamespace(points=points, normals=normals)


@pytest.fixture(scope="module")
def envelope(room, observed):
    cameras = tuple(capture.camera for capture in room.captures)
    return find_planes(observed, cameras, SETTINGS, np.random.default_rng(0)).envelope


@pytest.fixture(scope="module")
def completed(room):
    return [
        CompletedDepth(d.depth, np.full(d.depth.shape, DepthSource.OBSERVED, np.uint8), d.camera)
        for d in room.depth_maps
    ]


@pytest.fixture(scope="module")
def proxy(room, completed, observed, envelope):
    return compose_proxy(room.captures, completed, observed, envelope, (), SETTINGS)


def centroids(proxy):
    return proxy.vertices[proxy.faces].mean(1).astype(np.float64)


def normals(proxy):
    a, b, c = (proxy.vertices[proxy.faces[:, i]].astype(np.float64) for i in range(3))
    cross = np.cross(b - a, c - a)
    return cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-12)


def test_observed_faces_lie_on_the_true_surfaces(room, proxy):
    seen = proxy.provenance == Provenance.OBSERVED
    distance = room.distance(centroids(proxy))[seen]
    assert seen.mean() > 0.3
    assert np.median(distance) < 0.1 * VOXEL_M
    assert np.quantile(distance, 0.97) < VOXEL_M
    assert np.quantile(distance, 0.995) < 2 * VOXEL_M  # behind silhouettes, the truncation


def test_captures_see_the_true_depth_again(room, proxy):
    rasterizer = MeshRasterizer(proxy.vertices, proxy.faces)
    for truth in room.depth_maps:
        depth = rasterizer.render(truth.camera).depth
        assert (np.abs(depth - truth.depth) < 0.02 * truth.depth).mean() > 0.96


def test_faces_turn_towards_free_space(room, proxy):
    """Seen from a capture, a face's corners run counter-clockwise."""
    rasterizer = MeshRasterizer(proxy.vertices, proxy.faces)
    away = normals(proxy)
    for truth in room.depth_maps:
        face = rasterizer.render(truth.camera).face
        seen = np.unique(face[face >= 0])
        towards = truth.camera.centre - centroids(proxy)[seen]
        assert (np.einsum("ij,ij->i", away[seen], towards) > 0).mean() > 0.98


def test_support_counts_the_captures_that_see_a_face(room, proxy):
    """Compared with exact ray casting against the true mesh, away from edges."""
    points = centroids(proxy)
    on_wall = (np.abs(points[:, 1] - 1.5) < 0.02) & (proxy.provenance == Provenance.OBSERVED)
    chosen = np.flatnonzero(on_wall)[::97]
    count = np.zeros(len(chosen), int)
    for truth in room.depth_maps:
        pixels, depth = truth.camera.project(points[chosen])
        inside = truth.camera.sees(pixels, depth)
        u, v = np.where(inside[:, None], pixels, 0).astype(int).T
        count += inside & (np.abs(truth.depth[v, u] - depth) < 0.03 * depth)
    assert len(chosen) > 20
    assert (proxy.support[chosen] == count).mean() > 0.95
    assert (proxy.confidence[proxy.support > 2] > 0.5).mean() > 0.9


def test_the_envelope_closes_what_no_capture_saw(room, proxy):
    """A low view at the corner beside the captures still meets walls and floor."""
    camera = Camera(80, 60, 50.0, 50.0, 40.0, 30.0, look_at((1.0, 0.0, 1.2), (-2.0, -0.9, 0.2)))
    depth = MeshRasterizer(proxy.vertices, proxy.faces).render(camera).depth
    truth = MeshRasterizer(room.mesh.vertices, room.mesh.faces).render(camera).depth
    unseen_wall = camera.unproject(truth)[..., 1] < -1.49
    right = np.abs(depth - truth) < 0.03 * truth
    assert right[~unseen_wall].mean() > 0.97


def test_the_envelope_is_sheets_and_not_loose_cells(proxy):
    """What is selected as linked in Blender is a wall: no place of the proxy has two vertices."""
    assert len(np.unique(proxy.vertices, axis=0)) == len(proxy.vertices)


@pytest.mark.parametrize("guess", [DepthSource.ENVELOPE, DepthSource.FILLED])
def test_the_field_reaches_a_wall_that_is_only_guessed(room, completed, observed, envelope, guess):
    """Without any point on a wall (x = 2) it is fused as far as the captures look at it."""
    views, walls = [], []
    for view in completed:
        walls.append(view.camera.unproject(view.depth)[..., 0] > 1.95)
        views.append(dataclasses.replace(view, source=np.where(walls[-1], guess, view.source)))
    kept = observed.points[:, 0] < 1.9
    inside = SimpleNamespace(points=observed.points[kept], normals=observed.normals[kept])
    proxy = compose_proxy(room.captures, views, inside, envelope, (), SETTINGS)
    rasterizer = MeshRasterizer(proxy.vertices, proxy.faces)
    assert sum(wall.sum() for wall in walls) > 1000
    for view, wall in zip(views, walls, strict=True):
        near = np.abs(rasterizer.render(view.camera).depth - view.depth) < 0.05
        assert near[wall].mean() > 0.9


def test_an_unseen_wall_stays_open(proxy):
    camera = Camera(40, 30, 60.0, 60.0, 20.0, 15.0, look_at((0.0, -0.9, 1.3), (0.0, -2.0, 1.35)))
    assert (MeshRasterizer(proxy.vertices, proxy.faces).render(camera).face < 0).mean() > 0.9


def test_an_opening_that_was_seen_through_is_not_closed(room, completed, observed, envelope):
    """A doorway in the far wall: depth goes on behind it."""
    opened = []
    for view in completed:
        points = view.camera.unproject(view.depth)
        door = (points[..., 1] > 1.49) & (np.abs(points[..., 0] + 1.2) < 0.4)
        opened.append(dataclasses.replace(view, depth=np.where(door, view.depth * 1.6, view.depth)))
    proxy = compose_proxy(room.captures, opened, observed, envelope, (), SETTINGS)
    camera = Camera(30, 30, 90.0, 90.0, 15.0, 15.0, look_at((-1.2, -0.5, 1.2), (-1.2, 1.5, 1.2)))
    depth = MeshRasterizer(proxy.vertices, proxy.faces).render(camera).depth
    assert (np.abs(depth - 2.0) < 0.1).mean() < 0.05


def test_completed_surfaces_in_seen_free_space_are_carved(room, completed, observed, envelope):
    """One capture's filling puts a curtain into the room; the others look through it."""
    curtain = completed[1]
    source = curtain.source.copy()
    source[20:90, 30:120] = DepthSource.FILLED
    depth = np.where(source == DepthSource.FILLED, np.float32(0.9), curtain.depth)
    views = [completed[0], dataclasses.replace(curtain, depth=depth, source=source), *completed[2:]]
    proxy = compose_proxy(room.captures, views, observed, envelope, (), SETTINGS)
    points = centroids(proxy)
    _, z = curtain.camera.project(points)
    floating = (np.abs(z - 0.9) < 0.1) & (room.distance(points) > 0.15)
    assert floating.mean() < 0.002


def test_asset_depth_fills_what_the_captures_do_not_see(room, completed, observed):
    nothing = RoomPlanes(np.zeros((0, 3)), np.zeros(0), np.zeros(0, int), np.zeros(0, bool))
    camera = Camera(120, 90, 60.0, 60.0, 60.0, 45.0, look_at((0.0, 1.0, 1.4), (0.0, -1.5, 0.8)))
    depth = MeshRasterizer(room.mesh.vertices, room.mesh.faces).render(camera).depth
    asset = (camera, depth, np.ones(camera.shape, np.float32))
    counts = []
    for assets in ((), (asset,)):
        proxy = compose_proxy(room.captures, completed, observed, nothing, assets, SETTINGS)
        counts.append((np.abs(centroids(proxy)[:, 1] + 1.5) < 0.05).sum())
    assert counts[0] == 0
    assert counts[1] > 500


def test_a_prior_is_kept_and_replaces_what_else_is_in_its_region(room, completed, observed, envelope):
    mesh = trimesh.creation.box((1.0, 0.6, 0.7))
    mesh.apply_translation((0.9, 0.8, 0.35))
    prior = AlignedPrior("box", np.asarray(mesh.vertices), np.asarray(mesh.faces))
    proxy = compose_proxy(room.captures, completed, observed, envelope, (), SETTINGS, priors=[prior])
    kept = proxy.provenance == Provenance.PRIOR
    assert kept.sum() == len(mesh.faces)
    np.testing.assert_allclose(proxy.vertices[proxy.faces[kept]], mesh.vertices[mesh.faces], atol=1e-6)
    others = centroids(proxy)[~kept]
    near_top = (np.abs(others[:, 2] - 0.7) < 0.05) & (np.abs(others[:, :2] - (0.9, 0.8)) < (0.4, 0.2)).all(1)
    assert not near_top.any()
    floor = (np.abs(others[:, 2]) < 0.02) & (np.abs(others[:, 0]) < 0.3)
    assert floor.any()


def test_the_same_input_gives_the_same_bits(room, completed, observed, envelope, proxy):
    again = compose_proxy(room.captures, completed, observed, envelope, (), SETTINGS)
    for name in proxy.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(again, name), getattr(proxy, name))


def test_no_surface_is_an_error(room, completed, observed):
    nothing = RoomPlanes(np.zeros((0, 3)), np.zeros(0), np.zeros(0, int), np.zeros(0, bool))
    blind = [dataclasses.replace(view, depth=np.zeros_like(view.depth)) for view in completed]
    with pytest.raises(GeometryError):
        compose_proxy(room.captures, blind, observed, nothing, (), SETTINGS)
