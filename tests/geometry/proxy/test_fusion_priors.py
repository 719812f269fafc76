"""Priors in the geometry proxy: they take their region, and leave what captures saw on top of them."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from furniture import boxes, in_the_room, room_bounds

from r2sego_blender.captures.capture import Capture
from r2sego_blender.config.settings import ProxySettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.objects.prior_files import AlignedPrior
from r2sego_blender.geometry.proxy.fusion import compose_proxy
from r2sego_blender.geometry.proxy.proxy import Provenance
from r2sego_blender.geometry.room.completed_depth import CompletedDepth, DepthSource

SETTINGS = ProxySettings(voxel_m=0.04)
TABLE = (-0.5, -0.3, 0.0), (0.5, 0.3, 0.7)
BOOKS = (-0.1, -0.1, 0.7), (0.3, 0.15, 1.0)  # a pile of them


def composed(things, priors, seen_by=4):
    """The proxy of a room with ``things`` (boxes) in it; ``seen_by`` of the four captures know
    by stereo what stands on the table, for the others it is filled in."""
    rasterizer = in_the_room(*boxes(*things))
    captures, completed = [], []
    for index, x in enumerate((-1.2, -0.4, 0.5, 1.3)):
        camera = Camera(160, 120, 110.0, 110.0, 80.0, 60.0, look_at((x, -1.7, 1.7), (0.0, 0.1, 0.6)))
        depth = rasterizer.render(camera).depth
        points = camera.unproject(depth)
        sources = np.full(depth.shape, DepthSource.OBSERVED, np.uint8)
        if index >= seen_by:
            sources[(points[..., 2] > 0.72) & (np.abs(points[..., 1]) < 0.4)] = DepthSource.FILLED
        captures.append(Capture(f"{index}", None, camera))
        completed.append(CompletedDepth(depth, sources, camera))
    observed = SimpleNamespace(points=np.zeros((0, 3)))
    return compose_proxy(captures, completed, observed, room_bounds(), (), SETTINGS, priors=priors)


def prior_of(*parts) -> AlignedPrior:
    vertices, faces = boxes(*parts)
    return AlignedPrior("table", vertices, faces.astype(np.int32))


def split(proxy):
    """Centroids of the prior's faces, and of the others."""
    centroids = proxy.vertices[proxy.faces].mean(1).astype(float)
    prior = proxy.provenance == Provenance.PRIOR
    return centroids[prior], centroids[~prior]


def on_the_box(points, box, margin_m):
    """Points within ``margin_m`` of the surface of a box, its underside apart."""
    low, high = np.array(box)
    away = np.abs(points - (low + high) / 2) - (high - low) / 2
    distance = np.linalg.norm(np.maximum(away, 0), axis=1) + np.minimum(away.max(1), 0)
    return (np.abs(distance) < margin_m) & (points[:, 2] > low[2] + 2 * margin_m)


def area(proxy, chosen):
    triangles = proxy.vertices[proxy.faces[chosen]].astype(float)
    return trimesh.triangles.area(triangles).sum()


def test_the_prior_alone_stands_in_its_region():
    """The same room without the prior has the table's surface from the captures there."""
    prior = prior_of(TABLE)
    bare = composed([TABLE], [])
    assert on_the_box(split(bare)[1], TABLE, 0.03).sum() > 500
    proxy = composed([TABLE], [prior])
    kept, others = split(proxy)
    assert len(kept) == len(prior.faces)
    np.testing.assert_allclose(
        proxy.vertices[proxy.faces[proxy.provenance == Provenance.PRIOR]], prior.vertices[prior.faces], atol=1e-6
    )
    assert not on_the_box(others, TABLE, 0.03).any()
    inside = ((others > np.array(TABLE[0]) + 0.02) & (others < np.array(TABLE[1]) - 0.02)).all(1)
    assert not inside.any()


def test_the_rooms_bounds_stay_under_and_beside_a_prior():
    bare, proxy = composed([TABLE], []), composed([TABLE], [prior_of(TABLE)])
    for axis, bound in ((2, 0.0), (1, 2.0), (0, -2.5)):
        floors = []
        for one in (bare, proxy):
            centroids = one.vertices[one.faces].mean(1)
            on_bound = (np.abs(centroids[:, axis] - bound) < 0.02) & (one.provenance != Provenance.PRIOR)
            floors.append(area(one, on_bound))
        assert floors[1] > 0.95 * floors[0] > 3.0


def test_what_captures_saw_on_top_of_a_prior_stays():
    """The prior is the table alone; the books on it were seen by all."""
    proxy = composed([TABLE, BOOKS], [prior_of(TABLE)])
    bare = composed([TABLE, BOOKS], [])
    _, others = split(proxy)
    on_top = (np.abs(others[:, 2] - BOOKS[1][2]) < 0.03) & (np.abs(others[:, 0] - 0.1) < 0.2)
    assert on_top.sum() > 20
    upper = np.array([(-0.1, -0.1, 0.78), BOOKS[1]])
    before = on_the_box(split(bare)[1], upper, 0.03).sum()
    assert on_the_box(others, upper, 0.03).sum() > 0.9 * before > 100
    assert (proxy.provenance[proxy.provenance != Provenance.PRIOR][on_top] == Provenance.OBSERVED).mean() > 0.8


@pytest.mark.parametrize("seen_by", range(4))
def test_what_no_two_captures_saw_in_a_priors_hull_goes(seen_by):
    """A prior of the table and of a rack above it: what is between them needs two witnesses."""
    rack = (-0.5, -0.3, 1.1), (0.5, 0.3, 1.15)
    between = np.array([(-0.1, -0.1, 0.78), BOOKS[1]])
    count, everyones = (
        on_the_box(split(composed([TABLE, BOOKS], [prior_of(TABLE, rack)], seen))[1], between, 0.03).sum()
        for seen in (seen_by, 4)
    )
    assert everyones > 50
    assert count > 0.3 * everyones if seen_by >= 2 else count < 0.05 * everyones


def test_two_priors_keep_all_their_faces():
    first, second = prior_of(TABLE), prior_of(((1.2, 1.0, 0.0), (1.6, 1.4, 0.5)))
    proxy = composed([TABLE], [first, second])
    kept = proxy.vertices[proxy.faces[proxy.provenance == Provenance.PRIOR]]
    expected = np.concatenate([one.vertices[one.faces] for one in (first, second)])
    np.testing.assert_allclose(kept, expected, atol=1e-6)


def test_faces_know_which_objects_prior_they_are_of():
    stool = AlignedPrior("stool", *boxes(((1.0, -1.0, 0.0), (1.3, -0.7, 0.4))))
    proxy = composed([TABLE], [prior_of(TABLE), stool])
    assert proxy.instance_names == ("table", "stool")
    np.testing.assert_array_equal(proxy.instance > 0, proxy.provenance == Provenance.PRIOR)
    corners = proxy.vertices[proxy.faces[proxy.instance == 2]].reshape(-1, 3)
    np.testing.assert_allclose(corners.min(0), [1.0, -1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(corners.max(0), [1.3, -0.7, 0.4], atol=1e-6)


def test_a_flat_prior_takes_no_more_than_its_surface():
    """A rug has no inside."""
    vertices = np.array([[-0.6, -0.5, 0.01], [0.6, -0.5, 0.01], [0.6, 0.5, 0.01], [-0.6, 0.5, 0.01]])
    rug = AlignedPrior("rug", vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    prior, others = split(composed([TABLE], [rug]))
    assert len(prior) == 2 and on_the_box(others, TABLE, 0.03).sum() > 100
