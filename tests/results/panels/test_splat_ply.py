"""Blender's reader of splat files sees what the engine's does."""

import time

import fake_asset
import numpy as np
import pytest

from r2sego_blender.bundle.asset_stages import stage_named, stages
from r2sego_blender.core.errors import AssetError
from r2sego_blender.results.panels.splat_ply import read_splats, read_stage
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.ply import load_ply, save_ply


def assert_equal(shown, asset: SplatAsset) -> None:
    for name in ("means", "log_scales", "quaternions"):
        np.testing.assert_array_equal(getattr(shown, name), getattr(asset, name))
    np.testing.assert_array_equal(shown.opacities, asset.opacities)
    np.testing.assert_allclose(shown.colours, np.clip(asset.base_colours, 0.0, 1.0), atol=1e-7)
    assert not shown.backdrop.any()


@pytest.mark.parametrize("degree", [0, 3])
def test_it_reads_what_the_engine_reads(tmp_path, degree):
    save_ply(tmp_path / "a.ply", fake_asset.asset(4, degree=degree))
    assert_equal(read_splats(tmp_path / "a.ply"), load_ply(tmp_path / "a.ply"))


@pytest.mark.parametrize("name", ["means", "log_scales", "quaternions", "logit_opacities", "sh"])
def test_splats_that_the_engine_drops_are_not_shown(tmp_path, name):
    asset = fake_asset.asset(4, degree=2)
    getattr(asset, name).reshape(len(asset), -1)[7, -1] = np.nan
    save_ply(tmp_path / "a.ply", asset)
    shown = read_splats(tmp_path / "a.ply")
    assert len(shown) == fake_asset.SPLATS - 1
    assert_equal(shown, load_ply(tmp_path / "a.ply"))


def test_flat_splats_get_the_engines_thickness(tmp_path):
    save_ply(tmp_path / "a.ply", fake_asset.asset(4))
    flat = (tmp_path / "a.ply").read_bytes().replace(b"scale_2", b"unused2")
    (tmp_path / "a.ply").write_bytes(flat)
    assert_equal(read_splats(tmp_path / "a.ply"), load_ply(tmp_path / "a.ply"))


def test_a_radius_is_that_of_the_flat_side(tmp_path):
    asset = fake_asset.asset(4, count=1)
    asset.log_scales[0] = np.log([0.4, 0.001, 0.1])
    save_ply(tmp_path / "a.ply", asset)
    assert read_splats(tmp_path / "a.ply").radii_m == pytest.approx(0.2)


def test_a_file_without_opacity_is_refused(tmp_path):
    save_ply(tmp_path / "a.ply", fake_asset.asset(4))
    (tmp_path / "a.ply").write_bytes((tmp_path / "a.ply").read_bytes().replace(b"opacity", b"opaquee"))
    with pytest.raises(AssetError, match="opacity"):
        read_splats(tmp_path / "a.ply")


def test_the_backdrop_is_told_apart_in_every_stage(bundle):
    scene, backdrop = bundle.scene, bundle.scene.geometry_folder / "backdrop.ply"
    assert [stage.name for stage in stages(scene)] == ["initial", "0", "1", "final"]
    behind = {name: read_stage(stage_named(scene, name), backdrop).backdrop for name in ("initial", "0", "final")}
    assert not behind["initial"].any()
    for name in ("0", "final"):
        assert behind[name].tolist() == [False] * fake_asset.SPLATS + [True] * fake_asset.BACKDROP_SPLATS
    without = read_stage(stage_named(scene, "final"), None)
    assert_equal(without, load_ply(scene.asset_file))


def test_a_stage_that_is_not_there_is_named(bundle):
    with pytest.raises(AssetError, match="initial, 0, 1, final"):
        stage_named(bundle.scene, "7")


def test_two_hundred_thousand_splats_are_read_within_a_second(tmp_path):
    """A generous bound on a shared machine: processor time, not the clock's."""
    save_ply(tmp_path / "large.ply", fake_asset.asset(5, count=200_000, degree=3))
    begun = time.process_time()
    assert len(read_splats(tmp_path / "large.ply")) == 200_000
    assert time.process_time() - begun < 10.0
