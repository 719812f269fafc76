"""Patches of photographs carried onto planes: as a plain program does it, and alike on the true plane alone."""

import numpy as np
import pytest
from painted_room import LENS, painted_photographs, room_mesh

from r2sego_blender.captures.matching.plane_sweep import (
    _LEAST_VARIANCE,
    _PATCH_RADIUS_PX,
    _PATCH_STEP_PX,
    GreyView,
    likeness_on_planes,
    textured_pixels,
)
from r2sego_blender.core.cameras import look_at

BACK_WALL = np.array([0.0, -1.0, 0.0]), -1.5


@pytest.fixture(scope="module")
def views(tmp_path_factory):
    """Two photographs of the painted room's back wall, 40 cm apart."""
    cameras = [LENS.at(look_at((x, -1.2, 1.5), (x, 1.0, 1.3))) for x in (-0.2, 0.2)]
    captures = painted_photographs(tmp_path_factory.mktemp("sweep"), room_mesh(), cameras)
    return [GreyView.of(capture.image(), capture.camera) for capture in captures]


def plain_likeness(view, other, pixel, normal, offset):
    """What the kernel computes for one pixel, plane and other view; None out of its sight."""
    steps = np.arange(-_PATCH_RADIUS_PX, _PATCH_RADIUS_PX + 1, _PATCH_STEP_PX)
    columns, rows = (part.ravel() for part in np.meshgrid(pixel[0] + steps, pixel[1] + steps))
    rays = view.camera.rays()[rows, columns] @ view.camera.world_from_camera[:3, :3].T
    points = view.camera.centre + rays * ((offset - normal @ view.camera.centre) / (rays @ normal))[:, None]
    pixels, depth = other.camera.project(points)
    u, v = pixels.T - 0.5
    height, width = other.grey.shape
    if (depth <= 0).any() or (u < 0).any() or (v < 0).any() or (u > width - 2).any() or (v > height - 2).any():
        return None
    m, n = u.astype(int), v.astype(int)
    s, t = u - m, v - n
    there = (other.grey[n, m] * (1 - s) + other.grey[n, m + 1] * s) * (1 - t)
    there += (other.grey[n + 1, m] * (1 - s) + other.grey[n + 1, m + 1] * s) * t
    here = view.grey[rows, columns].astype(float)
    covariance = ((here - here.mean()) * (there - there.mean())).mean()
    return covariance / np.sqrt((here.var() + _LEAST_VARIANCE) * (there.var() + _LEAST_VARIANCE))


def test_the_kernel_computes_what_a_plain_program_does(views):
    rng = np.random.default_rng(5)
    a, b = views
    pixels, compared = textured_pixels(a), 0
    for _ in range(20):
        normal = np.array([0.0, -1.0, 0.0]) + rng.normal(size=3) * 0.2
        normal /= np.linalg.norm(normal)
        offset = rng.uniform(-2.5, -0.8)
        like, beyond = likeness_on_planes(a, [b], pixels, normal[None], np.array([offset]))
        assert not beyond.any()
        for i in rng.choice(len(pixels), 20):
            expected = plain_likeness(a, b, pixels[i], normal, offset)
            if expected is not None and like[0, i] > -2.0:
                assert abs(like[0, i] - expected) < 1e-3
                compared += 1
    assert compared > 100


def test_patches_of_a_wall_are_alike_on_it_and_not_beside_it(views):
    a, b = views
    normal, offset = BACK_WALL
    offsets = offset + np.array([-0.3, 0.0, 0.3])
    like, _ = likeness_on_planes(a, [b], textured_pixels(a), np.repeat(normal[None], 3, axis=0), offsets)
    alike = (like > 0.9).sum(axis=1)
    assert alike[1] > 50 and alike[1] > 4 * max(alike[0], alike[2])


def test_what_lies_behind_a_bound_is_not_compared_and_a_known_depth_beyond_is_looked_through(views):
    a, b = views
    (normal, offset), pixels = BACK_WALL, textured_pixels(a)
    plane = normal[None], np.array([offset])
    like, _ = likeness_on_planes(a, [b], pixels, *plane, bounds=(normal[None], np.array([offset + 0.5])))
    assert (like == -2.0).all()
    far = GreyView(b.camera, b.grey, np.full(b.camera.shape, 9.0, np.float32))
    like, beyond = likeness_on_planes(a, [far], pixels, *plane, free_margin=0.04)
    assert (like == -2.0).all() and beyond.any()
