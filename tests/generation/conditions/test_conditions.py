"""Structural conditions against exact ray casting."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from box_room import TABLE, arc, lens, proxy, render

from r2sego_blender.core.cameras import look_at
from r2sego_blender.generation.conditions.conditions import NOTHING, ZBufferRenderer
from r2sego_blender.geometry.proxy.proxy import GeometryProxy, Provenance
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer


@pytest.fixture(scope="module")
def conditions(box_room):
    return box_room.renderer.render(arc(2))


def test_depth_and_normals_are_those_of_ray_casting(conditions):
    for condition in conditions:
        _, depth = render(condition.camera)
        assert np.mean(np.abs(condition.depth - depth) < 1e-4 * depth) > 0.999
        points = condition.camera.unproject(condition.depth)
        floor = (points[..., 2] < 1e-4) & (condition.depth > 0)
        assert floor.mean() > 0.1
        np.testing.assert_allclose(condition.normal[floor], [[0, 0, 1]] * floor.sum(), atol=1e-6)


def test_provenance_and_validity_follow_the_faces(conditions):
    for condition in conditions:
        points = condition.camera.unproject(condition.depth)
        table = np.all((points > TABLE[0] - 1e-3) & (points < TABLE[1] + 1e-3), axis=-1)
        inside = cv2.erode(table.astype(np.uint8), np.ones((3, 3))) > 0
        assert inside.any()
        assert (condition.provenance[inside] == Provenance.OBSERVED + 1).all()
        assert (condition.provenance[~table & (points[..., 2] > 1e-3)] == Provenance.COMPLETED + 1).all()
        assert condition.validity.all()


def test_surfaces_seen_from_behind_are_not_valid(box_room):
    outside = lens().at(look_at([0.0, -6.0, 1.2], [0.0, 0.0, 1.2]))
    condition = box_room.renderer.condition(outside)
    shown = condition.depth > 0
    assert 0.05 < shown.mean() < 1.0
    assert not condition.validity.any()
    assert (condition.provenance[~shown] == NOTHING).all()
    assert not condition.normal[~shown].any()
    towards = np.einsum("hwc,hwc->hw", condition.normal_camera, condition.camera.rays())
    assert (towards[shown] <= 0.0).all()


def test_ray_distance_and_camera_normals_follow_from_depth_and_pose(conditions):
    for condition in conditions:
        away = np.linalg.norm(condition.camera.unproject(condition.depth) - condition.camera.centre, axis=-1)
        np.testing.assert_allclose(condition.distance, away, atol=1e-5)
        turned = np.einsum("ji,hwj->hwi", condition.camera.world_from_camera[:3, :3], condition.normal)
        np.testing.assert_allclose(condition.normal_camera, turned, atol=1e-6)


def test_instances_are_the_proxys_objects():
    table = np.arange(24) >= 12
    with_table = replace(proxy(), instance=np.where(table, 7, 0).astype(np.int32))
    (condition,) = ZBufferRenderer(with_table).render(arc(1))
    assert set(np.unique(condition.instance)) == {0, 7}
    np.testing.assert_array_equal(condition.instance == 7, condition.provenance == Provenance.OBSERVED + 1)


def test_passes_are_those_of_the_face_at_each_pixel_for_any_number_of_threads(with_threads):
    """Random triangles, both sides of them, against look-ups in numpy."""
    rng = np.random.default_rng(7)
    count = 30
    loose = GeometryProxy(
        rng.normal(size=(3 * count, 3)).astype(np.float32),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        rng.integers(0, 3, count).astype(np.uint8),
        rng.integers(0, 2, count).astype(np.uint16),
        np.ones(count, np.float32),
        rng.integers(0, 9, count).astype(np.int32),
    )
    camera = lens().at(look_at([0.2, -2.5, 0.4], [0.0, 0.0, 0.0]))
    face = MeshRasterizer(loose.vertices, loose.faces).render(camera).face
    seen = face >= 0
    assert 0.3 < seen.mean() < 1.0
    a, b, c = (loose.vertices[loose.faces[face, k]].astype(float) for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    rays = camera.rays() @ camera.world_from_camera[:3, :3].T
    free = (normal * rays).sum(-1) < 0
    with_one = with_threads(1, lambda: ZBufferRenderer(loose).render([camera]))
    rendered = with_one + ZBufferRenderer(loose).render([camera])
    for one in rendered:
        towards = np.where(free[..., None], normal, -normal)
        np.testing.assert_allclose(one.normal, np.where(seen[..., None], towards, 0.0), atol=1e-6)
        np.testing.assert_array_equal(one.provenance, np.where(seen, loose.provenance[face] + 1, 0))
        np.testing.assert_array_equal(one.validity, seen & free & (loose.support[face] > 0))
        np.testing.assert_array_equal(one.instance, np.where(seen, loose.instance[face], 0))
        np.testing.assert_array_equal(one.depth, rendered[0].depth)
