"""Counted pixels of silhouettes against NumPy and the z-buffer of the proxy."""

import cv2
import numpy as np
import pytest
from furniture import FURNITURE, narrower, wider
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.objects.silhouettes import (
    BOTH,
    DRAWN,
    FREE,
    HIDING_M,
    MASK_ONLY,
    NARROWER,
    NEAREST_SHAPE_M,
    SHAPE_ONLY,
    WIDER,
    MaskViews,
    count_pixels,
    scratch,
)
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer


def silhouette_counts(views, vertices, faces):
    """(V, 3, 4) counts by the kernel, of a shape that stands as it is."""
    counts = np.zeros((len(views.sizes), 3, 4), np.int64)
    work = scratch(views.sizes, len(vertices))
    count_pixels(views, np.eye(3), np.zeros(3), vertices, faces, *work, counts)
    return counts


def reference(cameras, masks, depths, vertices, faces):
    """(V, 3, 4) counts by NumPy from rendered depth."""
    counts = np.zeros((len(cameras), 3, 4), np.int64)
    rasterizer = MeshRasterizer(vertices, faces)
    for v, (camera, mask, known) in enumerate(zip(cameras, masks, depths, strict=True)):
        shape = rasterizer.render(camera).depth
        drawn, unknown = shape > 0, known == 0
        for width in (WIDER, DRAWN, NARROWER):
            inside = mask > width
            beside = drawn & ~inside
            counts[v, width, BOTH] = (drawn & inside).sum()
            counts[v, width, MASK_ONLY] = (inside & ~drawn).sum()
            counts[v, width, SHAPE_ONLY] = (beside & (unknown | (known > shape - HIDING_M))).sum()
            counts[v, width, FREE] = (beside & ~unknown & (known > shape + HIDING_M)).sum()
    return counts


def blob(rng, shape):
    """A mask as the three widths count it: a random round thing."""
    drawn = np.zeros(shape, np.uint8)
    centre = tuple(int(rng.integers(0, size)) for size in shape[::-1])
    cv2.ellipse(drawn, centre, (int(rng.integers(1, 25)), int(rng.integers(1, 25))), 30, 0, 360, 1, -1)
    return (wider(drawn).astype(np.uint8) + drawn + narrower(drawn)).astype(np.uint8)


def random_views(rng, count):
    cameras, masks, depths = [], [], []
    for _ in range(count):
        width, height = rng.integers(20, 70, 2)
        place = rng.normal(size=3)
        place *= 3.0 / np.linalg.norm(place)
        focal_px = rng.uniform(30, 60, 2)
        camera = Camera(int(width), int(height), *focal_px, width / 2, height / 2, look_at(place, np.zeros(3)))
        cameras.append(camera)
        masks.append(blob(rng, camera.shape))
        depth = rng.uniform(2.5, 3.5, camera.shape).astype(np.float32)
        depths.append(np.where(rng.random(camera.shape) < 0.3, np.float32(0), depth))
    return cameras, masks, depths


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_counts_equal_those_of_rendered_depth(seed):
    rng = np.random.default_rng(seed)
    views = random_views(rng, 3)
    vertices = rng.uniform(-0.8, 0.8, (30, 3))
    faces = rng.integers(0, 30, (20, 3)).astype(np.int32)
    expected = reference(*views, vertices, faces)
    found = silhouette_counts(MaskViews.of(*views), vertices, faces)
    assert expected[:, DRAWN].sum() > 0
    np.testing.assert_allclose(found, expected, atol=1)  # a pixel's centre may lie on an edge


def test_a_pixel_is_counted_once_in_a_closed_mesh():
    rng = np.random.default_rng(0)
    vertices, faces = FURNITURE["chair"]()
    views = random_views(rng, 4)
    expected = reference(*views, vertices - (0, 0, 0.5), faces)
    found = silhouette_counts(MaskViews.of(*views), vertices - (0, 0, 0.5), faces.astype(np.int32))
    np.testing.assert_allclose(found, expected, atol=2)
    assert (found[:, DRAWN, BOTH] + found[:, DRAWN, MASK_ONLY] == [(m > DRAWN).sum() for m in views[1]]).all()


CAMERA = Camera(40, 30, 40.0, 40.0, 20.0, 15.0, np.eye(4))
SHEET = np.array([[-0.2, -0.2, 2.0], [0.2, -0.2, 2.0], [0.2, 0.2, 2.0], [-0.2, 0.2, 2.0]])
SHEET_FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
SHEET_PX = 8 * 8


@pytest.mark.parametrize(
    ("known_m", "shape_only", "free"),
    [
        (0.0, SHEET_PX, 0),  # unknown
        (2.0, SHEET_PX, 0),
        (2.0 - 0.9 * HIDING_M, SHEET_PX, 0),
        (2.0 - 1.1 * HIDING_M, 0, 0),  # hidden
        (0.01, 0, 0),
        (2.0 + 0.9 * HIDING_M, SHEET_PX, 0),
        (2.0 + 1.1 * HIDING_M, SHEET_PX, SHEET_PX),
    ],
)
def test_known_depth_hides_or_frees_what_lies_outside_the_mask(known_m, shape_only, free):
    views = MaskViews.of([CAMERA], [np.zeros(CAMERA.shape)], [np.full(CAMERA.shape, known_m)])
    counts = silhouette_counts(views, SHEET, SHEET_FACES)[0, DRAWN]
    assert counts.tolist() == [0, 0, shape_only, free]


@pytest.mark.parametrize("known_m", [0.0, 0.5, 2.0, 9.0])
def test_inside_the_mask_known_depth_does_not_matter(known_m):
    views = MaskViews.of([CAMERA], [np.full(CAMERA.shape, 3)], [np.full(CAMERA.shape, known_m)])
    assert (silhouette_counts(views, SHEET, SHEET_FACES)[0] == [SHEET_PX, 40 * 30 - SHEET_PX, 0, 0]).all()


def test_faces_behind_the_camera_do_no_harm():
    """The counts are those of the faces that lie before it as a whole."""
    rng = np.random.default_rng(8)
    vertices = rng.uniform((-1, -1, -0.5), (1, 1, 1.5), (60, 3))
    vertices[:3] = [[0.1, 0.1, 0.0], [0.2, 0.0, 1e-12], [0.0, 0.2, NEAREST_SHAPE_M]]
    faces = np.concatenate([[[0, 1, 2]], rng.integers(0, 60, (60, 3))]).astype(np.int32)
    views = [CAMERA], [blob(rng, CAMERA.shape)], [rng.uniform(0.3, 1.5, CAMERA.shape).astype(np.float32)]
    before = faces[(vertices[faces][..., 2] >= NEAREST_SHAPE_M).all(1)]
    assert 5 < len(before) < len(faces) - 5
    found = silhouette_counts(MaskViews.of(*views), vertices, faces)
    np.testing.assert_allclose(found, reference(*views, vertices, before), atol=1)
    nothing = silhouette_counts(MaskViews.of(*views), vertices - (0, 0, 5), faces)
    assert (nothing[..., [BOTH, SHAPE_ONLY, FREE]] == 0).all()
