from __future__ import annotations

import numpy as np
import pytest

from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.formats.registry import load_asset, save_asset


def test_the_layout_is_what_viewers_expect(asset, tmp_path):
    save_asset(tmp_path / "a.splat", asset)
    data = (tmp_path / "a.splat").read_bytes()
    assert len(data) == 32 * len(asset)
    floats = np.frombuffer(data, "<f4").reshape(-1, 8)
    octets = np.frombuffer(data, "u1").reshape(-1, 32)
    importance = asset.opacities * np.exp(asset.log_scales).prod(axis=1)
    order = np.argsort(-importance, kind="stable")
    np.testing.assert_array_equal(floats[:, :3], asset.means[order])
    np.testing.assert_allclose(floats[:, 3:6], np.exp(asset.log_scales)[order], rtol=1e-6)
    np.testing.assert_allclose(octets[:, 24:27] / 255, asset.base_colours[order].clip(0, 1), atol=0.51 / 255)
    np.testing.assert_allclose(octets[:, 27] / 255, asset.opacities[order], atol=0.51 / 255)
    unit = asset.quaternions / np.linalg.norm(asset.quaternions, axis=1, keepdims=True)
    np.testing.assert_allclose(octets[:, 28:] / 128.0 - 1.0, unit[order], atol=1.01 / 128)


def test_gaussians_with_impossible_numbers_are_dropped(asset, tmp_path):
    path = tmp_path / "a.splat"
    save_asset(path, asset)
    records = np.frombuffer(path.read_bytes(), "<f4").reshape(-1, 8).copy()
    records[0, 0], records[1, 3], records[2, 4] = np.nan, -1.0, np.inf
    path.write_bytes(records.tobytes())
    assert len(load_asset(path)) == len(asset) - 3
    records[:, 0] = np.nan
    path.write_bytes(records.tobytes())
    with pytest.raises(AssetError, match="no Gaussian of the file has finite values"):
        load_asset(path)


@pytest.mark.parametrize("other", [".ply", ".spz", ".glb", ".usda", ".usdc"])
def test_another_format_under_this_suffix_is_recognised(asset, tmp_path, other):
    save_asset(tmp_path / f"a{other}", asset)
    (tmp_path / f"a{other}").rename(tmp_path / "a.splat")
    with pytest.raises(AssetError, match="another format"):
        load_asset(tmp_path / "a.splat")
