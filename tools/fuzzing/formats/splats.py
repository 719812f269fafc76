"""Splats of every registered format."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.registry import load_asset, save_asset

from ..harness import Harness
from ..seeds import camera, of_tests

_COUNT = 12


def _asset() -> SplatAsset:
    made: SplatAsset = of_tests("fake_asset").asset(1, _COUNT)
    return made


def _as(name: str) -> Callable[[Path], None]:
    def build(folder: Path) -> None:
        save_asset(folder / name, _asset())

    return build


def _as_ascii(folder: Path) -> None:
    """The binary PLY's vertices as text."""
    import numpy as np

    save_asset(folder / "a.ply", _asset())
    head, _, body = (folder / "a.ply").read_bytes().partition(b"end_header\n")
    count = head.count(b"property float")
    rows = np.frombuffer(body, "<f4").reshape(-1, count)
    lines = "\n".join(" ".join(f"{value:.6g}" for value in row) for row in rows)
    (folder / "a.ply").write_bytes(head.replace(b"binary_little_endian", b"ascii") + b"end_header\n" + lines.encode())


def _as_mip(folder: Path) -> None:
    """The text with Mip-Splatting's filter."""
    _as_ascii(folder)
    head, _, body = (folder / "a.ply").read_bytes().partition(b"end_header\n")
    lines = b"".join(line + b" 0.02\n" for line in body.splitlines())
    (folder / "a.ply").write_bytes(head + b"property float filter_3D\nend_header\n" + lines)


def _as_raw_spz(folder: Path) -> None:
    """Version 3 without its gzip."""
    save_asset(folder / "a.spz", _asset())
    (folder / "a.spz").write_bytes(gzip.decompress((folder / "a.spz").read_bytes()))


def _load(name: str) -> Callable[[Path], SplatAsset]:
    return lambda folder: load_asset(folder / name)


def _shown(folder: Path) -> Any:
    from r2sego_blender.results.panels.splat_ply import read_splats

    return read_splats(folder / "a.ply")


def _cameras(folder: Path) -> None:
    listed = [camera(number).to_json() for number in range(2)]
    (folder / "cameras.json").write_text(json.dumps({"width": 32, "cameras": listed}))


def _read_cameras(folder: Path) -> Any:
    from r2sego_blender.splats.rendering.pictures import camera_entries, cameras_of

    file = folder / "cameras.json"
    return cameras_of(camera_entries(file), file)


HARNESSES = (
    Harness("splats/cameras.json", _cameras, "cameras.json", "json", _read_cameras),
    Harness("splats/ply", _as("a.ply"), "a.ply", "header", _load("a.ply")),
    Harness("splats/ascii.ply", _as_ascii, "a.ply", "text", _load("a.ply")),
    Harness("splats/mip.ply", _as_mip, "a.ply", "text", _load("a.ply")),
    Harness("splats/compressed.ply", _as("a.compressed.ply"), "a.compressed.ply", "header", _load("a.compressed.ply")),
    Harness("splats/splat", _as("a.splat"), "a.splat", "bytes", _load("a.splat")),
    Harness("splats/spz", _as("a.spz"), "a.spz", "bytes", _load("a.spz")),
    Harness("splats/raw.spz", _as_raw_spz, "a.spz", "bytes", _load("a.spz")),
    Harness("splats/gltf", _as("a.gltf"), "a.gltf", "json", _load("a.gltf")),
    Harness("splats/glb", _as("a.glb"), "a.glb", "header", _load("a.glb")),
    Harness("splats/usda", _as("a.usda"), "a.usda", "text", _load("a.usda"), share=0.04),
    Harness("splats/usdc", _as("a.usdc"), "a.usdc", "bytes", _load("a.usdc"), share=0.04),
    Harness("splats/usdz", _as("a.usdz"), "a.usdz", "archive", _load("a.usdz"), share=0.04),
    Harness("splats/shown.ply", _as("a.ply"), "a.ply", "header", _shown),
)
