"""Colours in 3D: surfaces keep and continue their own, whatever the view; a plain reference."""

import numpy as np
import pytest
from box_room import ROOM, TABLE, arc, lens, proxy, render, texture, write_captures

from r2sego_blender.config.settings import GenerationSettings
from r2sego_blender.core.cameras import look_at
from r2sego_blender.generation.conditions.conditions import ZBufferRenderer
from r2sego_blender.generation.generators.blending import BlendingGenerator
from r2sego_blender.generation.generators.surface_colours import SurfaceColours, _sample, _splat, spread

UP = np.array([0.0, 0.0, 1.0])


def one_colour_a_side(points):
    """Floor, ceiling, each wall and the table have a colour of their own."""
    colour = np.full((*points.shape[:-1], 3), [0.9, 0.2, 0.9])
    for axis in range(3):
        for side in range(2):
            on = np.abs(points[..., axis] - ROOM[side][axis]) < 1e-4
            colour[on] = 0.1 + 0.8 * np.eye(3)[axis] * (0.5 + 0.5 * side)
    return colour


def colours_of(cameras, colour):
    images, depths = zip(*(render(camera, colour=colour) for camera in cameras), strict=True)
    return SurfaceColours(images, cameras, depths, [np.ones_like(depth) for depth in depths])


@pytest.fixture(scope="module")
def sides():
    return colours_of(arc(4), one_colour_a_side)


def test_a_surface_continues_its_own_colour(sides):
    """The floor under the table and behind the cameras is floor; the table's top is table."""
    floor = np.array([[0.0, 0.5, 0.0], [0.0, -1.9, 0.0], [1.9, -1.9, 0.0]])
    np.testing.assert_allclose(sides.at(floor, np.tile(UP, (3, 1))), np.tile([0.1, 0.1, 0.5], (3, 1)), atol=0.06)
    table = sides.at(np.array([[0.0, 0.5, TABLE[1][2]]]), UP[None])
    np.testing.assert_allclose(table, [[0.9, 0.2, 0.9]], atol=0.03)


def test_seen_surfaces_have_the_colours_seen():
    def slow(points):
        return texture(points / 8.0)

    cameras = arc(4)
    colours = colours_of(cameras, slow)
    points = cameras[1].unproject(render(cameras[1])[1])[40:-4:9, 8:-8:9].reshape(-1, 3)
    floor = points[np.abs(points[:, 2]) < 1e-5]
    assert len(floor) > 10
    found = colours.at(floor, np.tile(UP, (len(floor), 1)))
    assert np.abs(found - slow(floor)).mean() < 0.03


def test_a_turned_room_has_the_same_colours(sides):
    """Walls need not lie along the world's axes."""
    turn = np.eye(4)
    c, s = np.cos(0.4), np.sin(0.4)
    turn[:2, :2] = [[c, -s], [s, c]]
    cameras = arc(4)
    images, depths = zip(*(render(camera, colour=one_colour_a_side) for camera in cameras), strict=True)
    turned = [camera.transformed(turn) for camera in cameras]
    colours = SurfaceColours(images, turned, depths, [np.ones_like(depth) for depth in depths])
    rng = np.random.default_rng(0)
    points = np.stack([rng.uniform(-1.9, 1.9, 50), np.full(50, 2.0), rng.uniform(0.1, 2.4, 50)], axis=1)
    normal = np.tile([0.0, -1.0, 0.0], (50, 1))
    found = colours.at(points @ turn[:3, :3].T, normal @ turn[:3, :3].T)
    assert np.abs(found - sides.at(points, normal)).max() < 0.05


def test_holes_have_the_same_colour_in_every_frame(tmp_path):
    """Two views of the floor that no capture saw agree, point by point."""
    captures, depths = write_captures(tmp_path, arc(2)[:1])
    generator = BlendingGenerator(captures, depths, GenerationSettings())
    renderer = ZBufferRenderer(proxy())
    cameras = [lens().at(look_at([x, 0.9, 1.9], [0.3, -1.2, 0.0])) for x in (0.2, 0.35)]
    first, second = (generator.blend(renderer.condition(camera)) for camera in cameras)
    depth = renderer.depth(cameras[0])
    pixels, z = cameras[1].project(cameras[0].unproject(depth))
    shown = cameras[1].sees(pixels, z, margin_px=2.0)
    columns, rows = pixels[shown].astype(int).T
    visible = np.abs(renderer.depth(cameras[1])[rows, columns] - z[shown]) < 0.01
    unseen = (first.confidence[shown] < 0.11) & (second.confidence[rows, columns] < 0.11) & visible
    assert unseen.sum() > 1000
    apart = np.abs(first.image[shown] - second.image[rows, columns])[unseen]
    assert apart.mean() < 0.01


@pytest.mark.parametrize("seed", range(3))
def test_kernels_are_their_plain_references(seed):
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(2, 9, 3))
    places = rng.uniform(-0.5, 8.0, (200, 3)).astype(np.float32)
    weights = np.maximum(rng.normal(size=200), 0).astype(np.float32)
    colours = rng.random((200, 3), np.float32)
    known = np.zeros((*shape, 4), np.float32)
    _splat(places, weights, colours, known)
    expected = np.zeros((*shape, 4))
    corners = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    for place, weight, colour in zip(places, weights, colours, strict=True):
        if (place >= 0).all() and (place <= np.array(shape) - 1).all():
            share = np.prod(np.maximum(1.0 - np.abs(corners - place), 0.0), axis=-1) * weight
            expected += share[..., None] * [*colour, 1.0]
    np.testing.assert_allclose(known, expected, atol=0.02)
    grid = rng.random((*shape, 3), np.float32)
    inside = np.clip(places, 0, np.array(shape) - 1)
    expected = [
        np.einsum("abc,abck->k", np.prod(np.maximum(1.0 - np.abs(corners - p), 0.0), axis=-1), grid) for p in inside
    ]
    np.testing.assert_allclose(_sample(grid, places), expected, atol=0.005)


def test_spreading_keeps_the_known_and_stays_within_it():
    rng = np.random.default_rng(1)
    known = np.zeros((13, 22, 5, 4), np.float32)
    chosen = rng.random(known.shape[:3]) < 0.05
    known[chosen] = [*rng.random(3), 1.0]
    known[chosen, :3] = rng.random((chosen.sum(), 3))
    filled = spread(known, np.zeros(3, np.float32))
    np.testing.assert_allclose(filled[chosen], known[chosen, :3], atol=1e-5)
    assert filled.max() <= known[chosen, :3].max() + 1e-5
    np.testing.assert_allclose(spread(np.zeros_like(known), np.full(3, 0.3, np.float32)), 0.3, atol=1e-5)


def test_the_same_bits_for_one_and_two_threads(sides, with_threads):
    rng = np.random.default_rng(2)
    points, normals = rng.uniform(-2, 2, (500, 3)), rng.normal(size=(500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    with_one = with_threads(1, lambda: sides.at(points, normals))
    np.testing.assert_array_equal(with_one, sides.at(points, normals))
