from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.registry import SUFFIXES, load_asset, save_asset

LOSSLESS = (".ply", ".glb", ".gltf", ".usd", ".usda", ".usdc", ".usdz")


@pytest.mark.parametrize(("suffix", "least_db"), [*((s, 50.0) for s in LOSSLESS), (".spz", 35.0), (".splat", 35.0)])
def test_a_file_loaded_again_gives_the_same_views(asset, fidelity_db, tmp_path, suffix, least_db):
    save_asset(tmp_path / f"room{suffix}", asset)
    loaded = load_asset(tmp_path / f"room{suffix}")
    assert len(loaded) == len(asset)
    wanted = asset.with_degree(0) if suffix == ".splat" else asset
    assert loaded.degree == wanted.degree
    assert fidelity_db(loaded, wanted) >= least_db


@pytest.mark.parametrize("suffix", LOSSLESS)
def test_lossless_formats_keep_every_number(asset, tmp_path, suffix):
    save_asset(tmp_path / f"room{suffix}", asset)
    loaded = load_asset(tmp_path / f"room{suffix}")
    np.testing.assert_allclose(loaded.means, asset.means, atol=1e-6)
    np.testing.assert_allclose(loaded.log_scales, asset.log_scales, atol=1e-5)
    np.testing.assert_allclose(loaded.logit_opacities, asset.logit_opacities, atol=1e-4)
    np.testing.assert_allclose(loaded.sh, asset.sh, atol=1e-5)
    a, b = (q / np.linalg.norm(q, axis=1, keepdims=True) for q in (loaded.quaternions, asset.quaternions))
    np.testing.assert_allclose(np.abs((a * b).sum(axis=1)), 1.0, atol=1e-6)


@pytest.mark.parametrize("degree", range(4))
@pytest.mark.parametrize("suffix", [".spz", ".glb", ".usdc"])
def test_every_degree_survives(asset, fidelity_db, tmp_path, suffix, degree):
    save_asset(tmp_path / f"room{suffix}", asset.with_degree(degree))
    loaded = load_asset(tmp_path / f"room{suffix}")
    assert loaded.degree == (3 if degree and suffix == ".usdc" else degree)  # importers of USD take 0 or 3
    assert np.array_equal(loaded.with_degree(degree).with_degree(loaded.degree).sh, loaded.sh)
    assert fidelity_db(loaded, asset.with_degree(degree)) >= 35.0


@pytest.mark.parametrize("suffix", [".splat", ".spz", ".glb", ".gltf", ".usda", ".usdc", ".usdz"])
def test_a_file_written_twice_has_the_same_bytes(asset, tmp_path, suffix):
    first, second = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    save_asset(first, asset)
    save_asset(second, asset)
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("suffix", [s for s in SUFFIXES if s != ".splat"])
def test_an_empty_asset_survives(tmp_path, suffix):
    save_asset(tmp_path / f"none{suffix}", SplatAsset.empty(2))
    assert len(load_asset(tmp_path / f"none{suffix}")) == 0


def test_an_empty_asset_does_not_become_an_empty_file(tmp_path):
    with pytest.raises(AssetError, match="without Gaussians"):
        save_asset(tmp_path / "none.splat", SplatAsset.empty())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_gaussians_at_the_limits_are_written_and_those_beyond_left_out(asset, tmp_path, suffix):
    odd = asset.subset(np.arange(8))
    odd.quaternions[0] = 0.0  # the identity
    odd.log_scales[1], odd.log_scales[2] = -60.0, 60.0
    odd.logit_opacities[3], odd.logit_opacities[4] = -100.0, 100.0
    odd.means[5, 1] = odd.sh[6, 3, 2] = np.nan
    odd.log_scales[7, 0] = np.inf
    save_asset(tmp_path / f"odd{suffix}", odd)
    loaded = load_asset(tmp_path / f"odd{suffix}")
    assert len(loaded) == 5
    assert all(np.isfinite(v).all() for v in vars(loaded).values())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_failed_write_leaves_the_old_file_and_nothing_else(asset, tmp_path, suffix, monkeypatch):
    path = tmp_path / f"room{suffix}"
    path.write_text("before")

    def refused(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", refused)
    with pytest.raises(AssetError, match="No space left"):
        save_asset(path, asset)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_folder_that_is_not_there_is_named(asset, tmp_path: Path, suffix):
    with pytest.raises(AssetError, match="nowhere"):
        save_asset(tmp_path / "nowhere" / f"room{suffix}", asset)


def test_an_unknown_suffix_is_refused(asset, tmp_path):
    for call in (lambda p: save_asset(p, asset), load_asset):
        with pytest.raises(AssetError, match=r"'.xyz' is no format of splats.*\.spz"):
            call(tmp_path / "room.xyz")
