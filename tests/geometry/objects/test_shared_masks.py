"""Masks of one thing in several photographs, told from its neighbours by observed points."""

import numpy as np
import pytest
from furniture import FURNITURE, cameras_around, moved, standing

from r2sego_blender.geometry.objects.shared_masks import joined_masks
from r2sego_blender.geometry.stereo.observed_geometry import ObservedGeometry
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer


@pytest.fixture(scope="module")
def two_stools():
    """Masks of two stools in four photographs, and the points that those observe."""
    vertices, faces = FURNITURE["stool"]()
    stools = [moved(vertices, standing(10.0, place)) for place in ((-0.4, 0.0), (0.4, 0.1))]
    rasterizer = MeshRasterizer(np.concatenate(stools), np.concatenate([faces, faces + len(vertices)]))
    cameras = cameras_around((0.0, 0.0, 0.4), count=4, width=200)
    buffers = [rasterizer.render(camera) for camera in cameras]
    points = np.concatenate(
        [camera.unproject(one.depth)[one.face >= 0][::4] for camera, one in zip(cameras, buffers, strict=True)]
    )
    visibility = np.zeros((len(points), 4), bool)
    for k, (camera, one) in enumerate(zip(cameras, buffers, strict=True)):
        pixels, depth = camera.project(points)
        columns, rows = np.clip(pixels.astype(int), 0, [199, 149]).T
        visibility[:, k] = camera.sees(pixels, depth) & (np.abs(one.depth[rows, columns] - depth) < 0.02)
    empty = np.zeros_like(points, np.float32)
    observed = ObservedGeometry(points.astype(np.float32), empty, empty, visibility, np.ones(len(points)))
    masks = [
        (k, stool, (one.face >= 0) & (one.face // len(faces) == stool))
        for k, one in enumerate(buffers)
        for stool in range(2)
    ]
    return cameras, observed, masks


def groups_of(two_stools, labels):
    cameras, observed, masks = two_stools
    found = joined_masks([m for _, _, m in masks], [k for k, _, _ in masks], labels, cameras, observed)
    assert sorted(m for group in found for m in group) == list(range(len(masks)))
    return found, [[masks[m][:2] for m in group] for group in found]


def test_each_stool_is_one_thing_in_all_photographs(two_stools):
    _, groups = groups_of(two_stools, ["stool"] * 8)
    assert [len(group) for group in groups] == [4, 4]
    for group in groups:
        assert len({stool for _, stool in group}) == 1 and len({view for view, _ in group}) == 4


def test_masks_of_different_words_are_different_things(two_stools):
    labels = ["stool" if k < 4 else "chair" for k in range(8)]
    found, groups = groups_of(two_stools, labels)
    assert [len(group) for group in groups] == [2, 2, 2, 2]
    assert all(len({labels[m] for m in group}) == 1 for group in found)


def test_a_thing_is_once_in_a_photograph(two_stools):
    """A second, smaller mask of the same stool stays alone."""
    cameras, observed, masks = two_stools
    view, _, whole = masks[0]
    part = whole.copy()
    part[: np.flatnonzero(whole.any(1)).mean().astype(int)] = False
    all_masks = [m for _, _, m in masks] + [part]
    found = joined_masks(all_masks, [k for k, _, _ in masks] + [view], ["stool"] * 9, cameras, observed)
    views = [k for k, _, _ in masks] + [view]
    assert [8] in found and all(len({views[m] for m in group}) == len(group) for group in found)


def test_masks_without_points_are_joined_with_nothing(two_stools):
    cameras, observed, _ = two_stools
    corner = np.zeros(cameras[0].shape, bool)
    corner[:5, :5] = True
    assert joined_masks([corner, corner], [0, 1], ["a", "a"], cameras, observed) == [[0], [1]]
    assert joined_masks([], [], [], cameras, observed) == []
