"""Whatever a file holds, loading ends in an asset or an AssetError that names it, in little memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.formats.registry import SUFFIXES, load_asset, save_asset

IN_THIS_PROCESS = (".splat", ".spz", ".glb", ".gltf")
USD = (".usda", ".usdc", ".usdz")  # read by a process each: fewer cases
MEMORY_LIMIT_BYTES = 20 << 20


def loaded_or_refused(path) -> str:
    """'' or the message, which must name the file and the cure."""
    tracemalloc.start()
    try:
        load_asset(path)
    except AssetError as error:
        assert path.name in str(error)
        assert error.cure
        return error.what
    finally:
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < MEMORY_LIMIT_BYTES
    return ""


@pytest.fixture
def whole(asset, tmp_path, request) -> tuple:
    path = tmp_path / f"whole{request.param}"
    save_asset(path, asset.subset(np.arange(60)))
    return path, path.read_bytes()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_files_that_are_missing_empty_or_something_else(tmp_path, suffix):
    path = tmp_path / f"room{suffix}"
    assert "cannot be read" in loaded_or_refused(path)
    contents = [b"", b"glTF", b"NGSP", b"\x1f\x8b\x08", b"ply\n", b"PXR-USDC", b"#usda 1.0\n", b"{}", b"[1]", b"{" * 9]
    for content in contents:
        path.write_bytes(content)
        assert loaded_or_refused(path)


@pytest.mark.parametrize("whole", IN_THIS_PROCESS + USD, indirect=True)
def test_files_cut_short(whole):
    path, data = whole
    few = path.suffix in USD
    whole_without = 200 if path.suffix == ".usdz" else 4  # its list of files, which OpenUSD does not need
    for length in np.linspace(1, len(data) - whole_without, 5 if few else 60).astype(int):
        path.write_bytes(data[:length])
        message = loaded_or_refused(path)
        assert message or (path.suffix == ".splat" and length % 32 == 0)


@pytest.mark.parametrize("whole", IN_THIS_PROCESS + USD, indirect=True)
def test_files_with_bytes_changed(whole):
    path, data = whole
    rng = np.random.default_rng(0)
    few = path.suffix in USD
    for case in range(6 if few else 200):
        changed = bytearray(data)
        part = len(data) if case % 2 else min(len(data), 1500)  # headers, and JSON, stand first
        for _ in range(rng.integers(1, 8)):
            changed[rng.integers(0, part)] = rng.integers(256)
        path.write_bytes(changed)
        loaded_or_refused(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_name_that_is_a_folder(tmp_path, suffix):
    path = tmp_path / f"folder{suffix}"
    path.mkdir()
    assert loaded_or_refused(path)
