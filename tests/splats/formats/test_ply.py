from __future__ import annotations

import tracemalloc
import warnings
from pathlib import Path

import numpy as np
import pytest
from progress_recorder import ProgressRecorder
from splat_reference import random_asset, small_camera

from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.ply import load_ply, save_ply
from r2sego_blender.splats.formats.registry import load_asset
from r2sego_blender.splats.rendering.rasterizer import render

GROUPS = ("means", "log_scales", "quaternions", "logit_opacities", "sh")


def assert_same(a: SplatAsset, b: SplatAsset) -> None:
    for name in GROUPS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


@pytest.mark.parametrize("degree", range(4))
def test_a_round_trip_keeps_every_bit_and_the_image(tmp_path: Path, degree: int) -> None:
    asset = random_asset(np.random.default_rng(degree), degree=degree)
    save_ply(tmp_path / "a.ply", asset, comments=["SplatRenderMode: default"])
    loaded = load_ply(tmp_path / "a.ply")
    assert_same(loaded, asset)
    camera = small_camera()
    np.testing.assert_array_equal(render(loaded, camera).colour, render(asset, camera).colour)


def test_the_layout_is_that_of_the_original_code(tmp_path: Path) -> None:
    asset = random_asset(np.random.default_rng(0), count=5)
    save_ply(tmp_path / "a.ply", asset)
    header, _, body = (tmp_path / "a.ply").read_bytes().partition(b"end_header\n")
    names = [line.split()[2].decode() for line in header.splitlines() if line.startswith(b"property float")]
    assert names[:9] == ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"]
    assert names[9:54] == [f"f_rest_{k}" for k in range(45)]
    assert names[54:] == ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    rows = np.frombuffer(body, "<f4").reshape(5, 62)
    assert not rows[:, 3:6].any()
    np.testing.assert_array_equal(rows[:, 9:24], asset.sh[:, 1:, 0])  # all of red first
    np.testing.assert_array_equal(rows[:, 58:], asset.quaternions)


def written(path: Path, fields: list[str], values: np.ndarray, kind: str = "float", order: str = "little") -> Path:
    header = ["ply", f"format binary_{order}_endian 1.0", "comment antialiased", f"element vertex {len(values)}"]
    header += [f"property {kind} {name}" for name in fields] + ["end_header\n"]
    code = {"float": "f4", "double": "f8"}[kind]
    path.write_bytes("\n".join(header).encode() + values.astype(("<" if order == "little" else ">") + code).tobytes())
    return path


FIELDS = [f"rot_{k}" for k in range(4)] + ["opacity", "f_dc_0", "f_dc_1", "f_dc_2"]
FIELDS += ["z", "y", "x", "scale_1", "scale_0"]


@pytest.mark.parametrize(("kind", "order"), [("float", "little"), ("double", "little"), ("float", "big")])
def test_properties_are_found_by_name(tmp_path: Path, kind: str, order: str) -> None:
    values = np.random.default_rng(0).normal(size=(6, 14)).astype(np.float32)
    asset = load_ply(written(tmp_path / "a.ply", [*FIELDS, "scale_2"], values, kind, order))
    np.testing.assert_array_equal(asset.means, values[:, [10, 9, 8]])
    np.testing.assert_array_equal(asset.log_scales, values[:, [12, 11, 13]])
    np.testing.assert_array_equal(asset.quaternions, values[:, :4])


def test_a_2dgs_file_gets_thin_discs(tmp_path: Path) -> None:
    values = np.random.default_rng(0).normal(size=(6, 13)).astype(np.float32)
    asset = load_ply(written(tmp_path / "a.ply", FIELDS, values))
    assert (np.exp(asset.log_scales[:, 2]) < 0.0011 * np.exp(asset.log_scales[:, :2].min(axis=1))).all()


def test_mip_splattings_filter_widens_and_thins_as_a_convolution_does(tmp_path: Path) -> None:
    """With it the file is as one into which the filter was fused: covariance S + f^2 I, mass kept."""
    rng = np.random.default_rng(0)
    values = rng.normal(size=(200, 15)).astype(np.float32)
    values[:, 14] = np.where(rng.random(200) < 0.2, 0.0, rng.uniform(0.001, 5.0, 200))
    values[:20, 11] = -np.inf  # flat
    asset = load_ply(written(tmp_path / "mip.ply", [*FIELDS, "scale_2", "filter_3D"], values))
    without = load_ply(written(tmp_path / "a.ply", [*FIELDS, "scale_2"], values[:, :14]))
    same = values[:, 14] == 0.0
    assert_same(asset.subset(same), without.subset(same))
    variances = np.exp(2.0 * without.log_scales.astype(np.float64))
    wider = variances + values[:, 14:].astype(np.float64) ** 2
    np.testing.assert_allclose(np.exp(2.0 * asset.log_scales.astype(np.float64)), wider, rtol=1e-5)
    mass = [a.opacities * np.exp(a.log_scales.astype(np.float64).sum(axis=1)) for a in (asset, without)]
    np.testing.assert_allclose(*mass, rtol=1e-4)
    for part in ("means", "quaternions", "sh"):
        np.testing.assert_array_equal(getattr(asset, part), getattr(without, part))


def test_an_opacity_of_1_stays_one_of_a_filtered_gaussian(tmp_path: Path) -> None:
    values = np.zeros((3, 15), np.float32)
    values[:, 3] = 1.0
    values[:, 4] = np.inf, 900.0, -np.inf
    values[:, 14] = 0.5, 1e-30, 0.5
    asset = load_ply(written(tmp_path / "mip.ply", [*FIELDS, "scale_2", "filter_3D"], values))
    np.testing.assert_allclose(asset.opacities, [1.25**-1.5, 1.0], rtol=1e-5)


def test_properties_that_no_asset_keeps_are_named(tmp_path: Path) -> None:
    recorder = ProgressRecorder()
    known = [*FIELDS, "scale_2", "filter_3D", "nx", "red"]
    load_asset(written(tmp_path / "a.ply", known, np.ones((3, len(known)))), recorder)
    assert recorder.messages == []
    load_asset(written(tmp_path / "a.ply", [*known, "blur_radius"], np.ones((3, len(known) + 1))), recorder)
    [warning] = recorder.warnings
    assert warning.endswith("blur_radius") and "a.ply" in warning


def test_gaussians_that_are_not_finite_are_dropped(tmp_path: Path) -> None:
    asset = random_asset(np.random.default_rng(0), count=4)
    asset.means[1, 2], asset.sh[2, 5, 0] = np.nan, np.inf
    save_ply(tmp_path / "a.ply", asset)
    assert_same(load_ply(tmp_path / "a.ply"), asset.subset(np.array([0, 3])))


def test_opacities_of_1_and_scales_of_0_are_kept_that_others_write_as_infinite(tmp_path: Path) -> None:
    asset = random_asset(np.random.default_rng(0), count=4)
    asset.logit_opacities[1], asset.log_scales[2, 0] = np.inf, -np.inf
    asset.logit_opacities[3] = -np.inf  # of 0: seen nowhere
    save_ply(tmp_path / "a.ply", asset)
    loaded = load_ply(tmp_path / "a.ply")
    assert len(loaded) == 3
    assert loaded.opacities[1] > 1.0 - 1e-6 and np.isfinite(loaded.logit_opacities).all()
    assert loaded.log_scales[2, 0] < -20.0 and np.isfinite(loaded.log_scales).all()
    np.testing.assert_array_equal(loaded.means, asset.means[:3])


def test_a_file_without_any_finite_gaussian_is_told(tmp_path: Path) -> None:
    asset = random_asset(np.random.default_rng(0), count=4)
    asset.means[:] = np.nan
    save_ply(tmp_path / "a.ply", asset)
    with pytest.raises(AssetError, match="no Gaussian of the file"):
        load_ply(tmp_path / "a.ply")


def test_of_degree_4_the_first_three_are_kept(tmp_path: Path) -> None:
    fields = [*FIELDS, "scale_2", *(f"f_rest_{k}" for k in range(72))]
    values = np.random.default_rng(0).normal(size=(6, len(fields))).astype(np.float32)
    asset = load_ply(written(tmp_path / "a.ply", fields, values))
    assert asset.degree == 3
    for channel in range(3):
        first = 14 + 24 * channel
        np.testing.assert_array_equal(asset.sh[:, 1:, channel], values[:, first : first + 15])


def test_a_large_file_is_written_in_little_memory(tmp_path: Path) -> None:
    asset = random_asset(np.random.default_rng(0), count=40_000)
    tracemalloc.start()
    save_ply(tmp_path / "a.ply", asset)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (tmp_path / "a.ply").stat().st_size > 40_000 * 248
    assert peak < 15 << 20  # the file has 9.9 MB, and was held four times
    assert_same(load_ply(tmp_path / "a.ply"), asset)


def test_an_element_before_the_vertices_is_passed_over(tmp_path: Path) -> None:
    asset = random_asset(np.random.default_rng(0), count=5)
    save_ply(tmp_path / "a.ply", asset)
    head, _, body = (tmp_path / "a.ply").read_bytes().partition(b"end_header\n")
    head = head.replace(b"element vertex", b"element camera 2\nproperty double fx\nelement vertex")
    (tmp_path / "a.ply").write_bytes(head + b"end_header\n" + bytes(16) + body)
    assert_same(load_ply(tmp_path / "a.ply"), asset)
    lists = head.replace(b"property double fx", b"property list uchar int ids")
    (tmp_path / "a.ply").write_bytes(lists + b"end_header\n" + bytes(2) + body)
    with pytest.raises(AssetError, match="'camera' stands before the vertices"):
        load_ply(tmp_path / "a.ply")


def test_an_element_that_reaches_beyond_its_file_is_cut_short(tmp_path: Path) -> None:
    save_ply(tmp_path / "a.ply", random_asset(np.random.default_rng(0), count=0))
    head, _, _ = (tmp_path / "a.ply").read_bytes().partition(b"end_header\n")
    before = head.replace(b"element vertex", b"element camera 9\nproperty double fx\nelement vertex")
    for content in (before + b"end_header\n" + bytes(71), before + b"end_header"):
        (tmp_path / "a.ply").write_bytes(content)
        with pytest.raises(AssetError, match="cut short: the element 'camera' needs 72 bytes"):
            load_ply(tmp_path / "a.ply")
    (tmp_path / "a.ply").write_bytes(before + b"end_header\n" + bytes(72))
    assert len(load_ply(tmp_path / "a.ply")) == 0


def test_a_text_file_without_gaussians_is_read_without_a_warning(tmp_path: Path) -> None:
    properties = "".join(f"property float {name}\n" for name in [*FIELDS, "scale_2"])
    header = f"ply\nformat ascii 1.0\nelement vertex 0\n{properties}end_header\n"
    (tmp_path / "a.ply").write_text(header)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(load_ply(tmp_path / "a.ply")) == 0


def test_damaged_files_say_what_is_wrong(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    save_ply(path, random_asset(np.random.default_rng(0), count=9))
    whole = path.read_bytes()
    cases = [
        (whole[:-1], "cut short"),
        (whole.replace(b"rot_3", b"rot_9"), "rot_3"),
        (whole.replace(b"f_rest_44", b"f_last_44"), "44 f_rest"),
        (b"obj", "not a PLY"),
        (b"", "empty"),
        (whole.replace(b"binary_little_endian", b"binary_middle"), "binary_middle"),
        (whole.replace(b"property float opacity", b"property list uchar int opacity"), "scalar"),
    ]
    for data, message in cases:
        path.write_bytes(data)
        with pytest.raises(AssetError, match=message):
            load_ply(path)
    with pytest.raises(AssetError, match="cannot be read"):
        load_ply(tmp_path / "none.ply")


def test_an_empty_asset_survives(tmp_path: Path) -> None:
    save_ply(tmp_path / "a.ply", SplatAsset.empty(1))
    assert_same(load_ply(tmp_path / "a.ply"), SplatAsset.empty(1))
