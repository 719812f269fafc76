"""The list of captures and the drawn points, as the bundle has them."""

import os
import shutil
from dataclasses import replace

import numpy as np
import pytest
from expected_errors import refused

from r2sego_blender.captures.sparse_points import SPARSE
from r2sego_blender.core.errors import SceneError
from r2sego_blender.results.panels.bundle import Bundle
from r2sego_blender.results.panels.capture_list import horizontal_view_deg, listed_captures, overlap_counts
from r2sego_blender.results.panels.sparse_cloud import cloud_at, forget_clouds, read_cloud


@pytest.fixture
def copy(bundle_path, tmp_path):
    shutil.copytree(bundle_path, tmp_path / "copy.r2s")
    return Bundle.open(tmp_path / "copy.r2s")


def test_a_line_tells_size_lens_points_and_overlaps(bundle):
    first, second, _ = listed_captures(bundle)
    assert (first.name, first.width, first.height, first.points, first.overlaps) == ("capture_0", 64, 48, 50, 2)
    assert first.view_deg == pytest.approx(2 * np.degrees(np.arctan(32 / 50)))
    off_centre = np.degrees(np.arctan(47.75 / 71.5) + np.arctan((80 - 47.75) / 71.5))
    assert second.view_deg == pytest.approx(off_centre) == horizontal_view_deg(80, 71.5, 47.75)


def test_overlaps_count_other_captures_with_enough_shared_points():
    visibility = np.zeros((60, 4), bool)
    visibility[:40, 0] = visibility[20:, 1] = True  # 20 in common
    visibility[:10, 2] = True  # too few with anyone
    np.testing.assert_array_equal(overlap_counts(visibility), [1, 1, 0, 0])
    many = np.repeat(visibility, 1000, axis=0)  # counted on a sample
    np.testing.assert_array_equal(overlap_counts(many), [2, 1, 1, 0])


def test_without_sparse_points_there_are_no_counts(copy):
    copy.sparse_file.unlink()
    assert [(one.points, one.overlaps) for one in listed_captures(copy)] == [(0, 0)] * 3
    assert read_cloud(copy) is None


def test_points_of_other_captures_are_refused(copy):
    sparse = copy.read(SPARSE)
    replace(sparse, visibility=sparse.visibility[:, :2], pixels=sparse.pixels[:, :2]).save(copy.sparse_file)
    with refused(SceneError, "captures/sparse.npz", "2 captures, there are 3"):
        listed_captures(copy)


def test_the_cloud_is_read_once_and_again_when_its_file_changed(copy):
    forget_clouds()
    assert cloud_at(str(copy.path)) is None
    cloud = read_cloud(copy)
    points, colours = copy.sparse_points()
    assert not np.array_equal(cloud.points, points)  # in an order of its own
    order = np.array([np.flatnonzero((points == point).all(axis=1))[0] for point in cloud.points])
    assert sorted(order) == list(range(len(points)))
    linear = cloud.colours[:, :3].astype(np.float64)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    np.testing.assert_array_equal(np.rint(srgb * 255), colours[order])
    assert read_cloud(copy) is cloud is cloud_at(str(copy.path))
    os.utime(copy.sparse_file, ns=(1, 1))
    assert read_cloud(copy) is not cloud
    forget_clouds()
    assert cloud_at(str(copy.path)) is None
