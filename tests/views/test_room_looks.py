"""A mesh as what a room looks like: its own picture to the bit where no body is, and bodies by plain depth."""

from __future__ import annotations

import numpy as np

from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.images import to_uint8
from r2sego_blender.geometry.texture.surface_light_field import SurfaceLightField, texel_counts, texel_middles
from r2sego_blender.views.room_looks import SurfaceLooks

CAMERA = Camera(32, 24, 20.0, 20.0, 16.0, 12.0, np.eye(4))
WALL_M = 2.0


def wall() -> SurfaceLightField:
    """Across the left three quarters of the view, ``WALL_M`` ahead."""
    vertices = np.float32([[-4, -4, WALL_M], [0.8, -4, WALL_M], [0.8, 4, WALL_M], [-4, 4, WALL_M]])
    faces = np.int32([[0, 1, 2], [0, 2, 3]])
    texels = texel_counts(vertices, faces, 0.2)
    middles, _ = texel_middles(vertices, faces, texels)
    light = (1.5 + np.sin(2.0 * middles[:, None])).astype(np.float32)
    return SurfaceLightField(vertices, faces, texels, light, np.float32([0.1, 0.2, 0.3]))


def test_without_bodies_the_picture_is_the_light_fields_to_the_bit():
    colour, depth_m = wall().render(CAMERA)
    nothing = np.zeros(CAMERA.shape, np.float32), np.zeros((*CAMERA.shape, 3), np.float32)
    for bodies in (None, nothing):
        seen = SurfaceLooks(wall()).seen(CAMERA, bodies)
        np.testing.assert_array_equal(seen.colour, to_uint8(colour))
        np.testing.assert_array_equal(seen.depth_m, depth_m)
        assert not seen.body.any()
    np.testing.assert_allclose(depth_m[:, :20], WALL_M, rtol=1e-6)
    assert not depth_m[:, 26:].any()


def test_a_body_is_seen_where_it_is_nearer_than_the_mesh_or_nothing_is_behind_it():
    looks, red = SurfaceLooks(wall()), np.float32([1.0, 0.0, 0.0])
    alone = looks.seen(CAMERA, None)
    rng = np.random.default_rng(1)
    depth_m = rng.choice(np.float32([0.0, 1.0, 1.99, 2.01, 3.0]), CAMERA.shape)
    seen = looks.seen(CAMERA, (depth_m, np.broadcast_to(red, (*CAMERA.shape, 3))))
    for row, column in np.ndindex(*CAMERA.shape):
        body, room = depth_m[row, column], alone.depth_m[row, column]
        before = body > 0.0 and (room == 0.0 or body < room)
        assert seen.body[row, column] == before
        assert seen.depth_m[row, column] == (body if before else room)
        expected = 255 * red if before else alone.colour[row, column]
        np.testing.assert_array_equal(seen.colour[row, column], expected)
