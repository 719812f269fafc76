"""What each depth weighs in the fused surface, and what a face owes to which capture, in closed form."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from r2sego_blender.captures.capture import Capture
from r2sego_blender.config.settings import ProxySettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.proxy.fusion import compose_proxy, face_evidence
from r2sego_blender.geometry.proxy.proxy import Provenance
from r2sego_blender.geometry.room.completed_depth import CompletedDepth, DepthSource
from r2sego_blender.geometry.room.planes import RoomPlanes
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

CAMERA = Camera(120, 90, 100.0, 100.0, 60.0, 45.0, look_at((0.0, 0.0, 1.0), (0.0, 2.0, 1.0)))
NO_PLANES = RoomPlanes(np.zeros((0, 3)), np.zeros(0), np.zeros(0, int), np.zeros(0, bool))
OBSERVED, PLANE, FILLED = DepthSource.OBSERVED, DepthSource.PLANE, DepthSource.FILLED
ESTIMATED = DepthSource.ESTIMATED


def wall(depth_m, source):
    """A wall at y = ``depth_m``, a number or (H, W), as the camera sees it."""
    depth = np.broadcast_to(np.asarray(depth_m, np.float32), CAMERA.shape)
    return CompletedDepth(depth.copy(), np.broadcast_to(np.uint8(source), CAMERA.shape).copy(), CAMERA)


def estimate(depth_m, certainty, source=ESTIMATED):
    """A wall that an estimator put there, where ``source`` says so."""
    one = wall(depth_m, source)
    return replace(one, certainty=np.where(one.source == ESTIMATED, np.float32(certainty), np.float32(0.0)))


def fused(views, asset_depths=(), **settings):
    captures = [Capture(str(k), None, view.camera) for k, view in enumerate(views)]
    nothing = SimpleNamespace(points=np.zeros((0, 3)))
    whole = ProxySettings(voxel_m=0.04, **settings)
    return compose_proxy(captures, views, nothing, NO_PLANES, asset_depths, whole)


def centroids(proxy):
    return proxy.vertices[proxy.faces].mean(axis=1).astype(float)


@pytest.mark.parametrize(
    ("sources", "completed_weight", "farther"),
    [
        ((OBSERVED, FILLED), 0.25, 0.25 / 1.25),
        ((PLANE, FILLED), 0.1, 0.1 / 0.4),  # a plane weighs three times what is filled in
        ((OBSERVED, PLANE), 0.1, 0.3 / 1.3),
        ((OBSERVED, PLANE), 0.5, 0.5),  # but no more than what was observed
    ],
)
def test_two_depths_meet_at_their_weighted_mean(sources, completed_weight, farther):
    near, far = (wall(depth, source) for depth, source in zip((2.0, 2.04), sources, strict=True))
    found = centroids(fused([near, far], completed_weight=completed_weight))[:, 1]
    assert np.median(found) == pytest.approx(2.0 + 0.04 * farther, abs=5e-4)


@pytest.mark.parametrize(("alpha", "weight"), [(1.0, 0.5), (0.6, 0.3), (0.4, 0.0)])
def test_the_assets_depth_weighs_by_its_alpha_where_it_is_opaque(alpha, weight):
    asset = (CAMERA, np.full(CAMERA.shape, 2.04, np.float32), np.full(CAMERA.shape, alpha, np.float32))
    found = centroids(fused([wall(2.0, OBSERVED)], [asset], asset_weight=0.5))[:, 1]
    assert np.median(found) == pytest.approx(2.0 + 0.04 * weight / (1.0 + weight), abs=5e-4)


def test_only_faces_on_trusted_stereo_are_observed():
    half = np.where(np.arange(CAMERA.width) < 60, OBSERVED, FILLED)
    proxy = fused([wall(2.0, half)])
    x = centroids(proxy)[:, 0]
    assert (np.abs(x) > 0.1).sum() > 500
    assert (proxy.provenance[x < -0.1] == Provenance.OBSERVED).all()
    assert (proxy.provenance[x > 0.1] == Provenance.COMPLETED).all()
    assert (proxy.support[np.abs(x) < 1.0] == 1).all()


def test_what_two_captures_filled_in_goes_where_one_looks_through_it():
    through = np.where(np.arange(CAMERA.width) < 60, 2.0, 0.0)
    views = [wall(through, OBSERVED), wall(1.5, FILLED), wall(1.5, FILLED)]
    found = centroids(fused(views, completed_weight=1.0))
    curtain = found[np.abs(found[:, 1] - 1.5) < 0.05]
    assert (curtain[:, 0] > 0.1).sum() > 200
    assert not (curtain[:, 0] < -0.1).any()


def test_loose_pieces_below_the_least_area_are_dropped():
    proxy = fused([wall(2.0, OBSERVED)])  # 2.4 by 1.8 metres
    corners = proxy.vertices[proxy.faces].astype(float)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert area.sum() == pytest.approx(2.4 * 1.8, rel=0.1)
    assert len(fused([wall(2.0, OBSERVED)], min_component_m2=3.5).faces) == len(proxy.faces)
    with pytest.raises(GeometryError, match="no surface"):
        fused([wall(2.0, OBSERVED)], min_component_m2=5.0)


def test_a_capture_speaks_for_the_faces_whose_front_it_sees():
    """Half the doubt for each capture whose stereo lies on a face, a fifth less for each chosen plane."""
    vertices = np.array([[-1.0, 2.0, 0.5], [1.0, 2.0, 0.5], [0.0, 2.0, 1.5]])
    front, back = np.array([[0, 1, 2]]), np.array([[0, 2, 1]])
    edge_on = Camera(120, 90, 100.0, 100.0, 60.0, 45.0, look_at((-3.0, 1.9, 0.9), (0.0, 2.0, 0.9)))
    flat = [CompletedDepth(np.full(CAMERA.shape, 3.0, np.float32), np.full(CAMERA.shape, OBSERVED), edge_on)]
    views = [wall(2.0, OBSERVED), wall(2.0, OBSERVED), wall(2.0, PLANE), wall(2.0, FILLED)]
    for faces, support, observed, planar in ((front, 4, 2, 1), (back, 0, 0, 0)):
        found = face_evidence(vertices, faces, MeshRasterizer(vertices, faces), [*views, *flat])
        assert [part.tolist() for part in found[:2]] == [[support], [observed]]
        assert found[2] == pytest.approx(1.0 - 0.9 * 0.5**observed * 0.8**planar)


def test_an_estimate_weighs_as_a_plane_by_its_certainty():
    found = centroids(fused([wall(2.0, FILLED), estimate(2.04, 0.5)]))[:, 1]
    assert np.median(found) == pytest.approx(2.0 + 0.04 * 0.15 / 0.25, abs=5e-4)


def test_faces_are_estimated_where_nothing_was_seen_and_as_certain_as_the_estimate():
    half = np.where(np.arange(CAMERA.width) < 60, OBSERVED, ESTIMATED)
    proxy = fused([estimate(2.0, 0.7, half)])
    x = centroids(proxy)[:, 0]
    assert (np.abs(x) > 0.1).sum() > 500
    assert (proxy.provenance[x < -0.1] == Provenance.OBSERVED).all()
    assert (proxy.provenance[x > 0.1] == Provenance.ESTIMATED).all()
    assert np.allclose(proxy.confidence[x > 0.1], 0.7, atol=1e-6)


def test_what_captures_see_through_is_carved_though_it_was_estimated():
    beside = Camera(120, 90, 100.0, 100.0, 60.0, 45.0, look_at((0.5, 0.0, 1.0), (0.0, 2.0, 1.0)))
    rays = beside.unproject(np.ones(beside.shape)) - beside.centre
    seen = CompletedDepth((3.0 / rays[..., 1]).astype(np.float32), np.full(beside.shape, np.uint8(OBSERVED)), beside)
    proxy = fused([estimate(1.5, 0.9), seen, seen])
    asked = beside.sees(*beside.project(centroids(proxy)))
    assert asked.sum() > 500 and (centroids(proxy)[asked, 1] > 2.5).all()
    alone = fused([estimate(1.5, 0.9)])
    assert (centroids(alone)[:, 1] < 1.6).all()
