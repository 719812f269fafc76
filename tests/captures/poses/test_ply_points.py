"""Points of a PLY file, coloured or not."""

import contextlib

import numpy as np
import pytest
import trimesh
from expected_errors import refused
from splat_photographs import room_points, write_points
from splats.splat_reference import random_asset

from r2sego_blender.captures.poses.ply_points import read_ply_points
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.resources import forget_peak_memory, peak_memory_mb
from r2sego_blender.splats.formats.registry import save_asset
from r2sego_blender.splats.harmonics import SH_BAND_0


def test_points_of_a_ply_with_and_without_colours(tmp_path):
    points, colours = read_ply_points(write_points(tmp_path / "points.ply"))
    np.testing.assert_allclose(points, room_points()[0], atol=1e-6)
    np.testing.assert_array_equal(colours, room_points()[1])

    trimesh.PointCloud(room_points()[0]).export(tmp_path / "bare.ply")
    assert (read_ply_points(tmp_path / "bare.ply")[1] == 128).all()

    box = trimesh.creation.box()
    box.visual.vertex_colors = np.tile([200, 100, 50, 255], (len(box.vertices), 1))
    box.export(tmp_path / "box.ply")
    points, colours = read_ply_points(tmp_path / "box.ply")
    assert len(points) == 8 and (colours == [200, 100, 50]).all()


def test_points_of_splats_have_the_colours_of_these(tmp_path):
    """As 3DGS writes them, without red, green and blue."""
    asset = random_asset(np.random.default_rng(0), 20, degree=1)
    save_asset(tmp_path / "asset.ply", asset)
    points, colours = read_ply_points(tmp_path / "asset.ply")
    np.testing.assert_array_equal(points, asset.means)
    np.testing.assert_allclose(colours, 255.0 * (SH_BAND_0 * asset.sh[:, 0] + 0.5).clip(0.0, 1.0), atol=0.51)


@pytest.mark.parametrize("content", [b"", b"no ply", b"ply\nformat ascii 1.0\nend_header\n"])
def test_a_ply_without_points_is_named(tmp_path, content):
    (tmp_path / "points.ply").write_bytes(content)
    with refused(CaptureError, "points.ply"):
        read_ply_points(tmp_path / "points.ply")


def test_colours_of_another_shape_are_none(tmp_path):
    """Of red alone no colour is made."""
    head = "ply\nformat ascii 1.0\nelement vertex 2\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    (tmp_path / "points.ply").write_text(head + "property uchar red\nend_header\n0 0 0 9\n1 1 1 7\n")
    points, colours = read_ply_points(tmp_path / "points.ply")
    assert len(points) == 2 and (colours == 128).all()


def test_one_point_among_others_that_is_nowhere_is_left_out(tmp_path):
    head = "ply\nformat ascii 1.0\nelement vertex 2\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    head += "".join(f"property uchar {colour}\n" for colour in ("red", "green", "blue")) + "end_header\n"
    (tmp_path / "points.ply").write_text(head + "inf 0.0 1.5 0 20 30\n1 0.5 1.5 10 20 30\n")
    points, colours = read_ply_points(tmp_path / "points.ply")
    assert points.tolist() == [[1.0, 0.5, 1.5]] and colours.shape == (1, 3)


@pytest.mark.parametrize("count", [10**9, 2**31, 2**62, "9" * 5000, -1])
@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_more_points_than_the_file_holds_take_no_memory(tmp_path, count, kind):
    head = f"ply\nformat {kind} 1.0\nelement vertex {count}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    (tmp_path / "points.ply").write_bytes(head.encode() + b"0 0 0\n" * 4)
    forget_peak_memory()
    before_mb = peak_memory_mb()
    with contextlib.suppress(CaptureError):  # of a text those that are there may count
        points, _ = read_ply_points(tmp_path / "points.ply")
        assert len(points) <= 4
    assert before_mb is None or peak_memory_mb() - before_mb < 200.0
