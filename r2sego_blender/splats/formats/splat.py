"""Assets as ``.splat`` files: 32 bytes a Gaussian, no view-dependent colour, no header."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...core.errors import AssetError
from ..asset import SplatAsset
from ..harmonics import SH_BAND_0
from ..quaternions import unit_quaternions
from .files import content, publishing
from .record import SplatFormat
from .values import linear_scales, log_scales, logits_of_bytes, to_bytes

_RECORD = np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("colour", "u1", 4), ("quaternion", "u1", 4)])


def save_splat(path: Path, asset: SplatAsset) -> None:
    """Write ``asset`` at degree 0, the most visible Gaussians first, in the world's axes."""
    asset = asset.finite()
    if not len(asset):
        raise AssetError("a .splat file cannot hold an asset without Gaussians", where=path, cure="Use .ply.")
    importance = np.log(asset.opacities) + asset.log_scales.sum(axis=1)  # of opacity times volume
    asset = asset.subset(np.argsort(-importance, kind="stable"))
    records = np.empty(len(asset), _RECORD)
    records["mean"] = asset.means
    records["scale"] = linear_scales(asset)
    records["colour"][:, :3] = to_bytes(asset.base_colours * 255.0)
    records["colour"][:, 3] = to_bytes(asset.opacities * 255.0)
    records["quaternion"] = to_bytes(unit_quaternions(asset.quaternions) * 128.0 + 128.0)
    with publishing(path) as staging:
        staging.write_bytes(records.tobytes())


def load_splat(path: Path) -> SplatAsset:
    """Read a ``.splat`` file: degree 0, axes as they stand in the file.

    Raises AssetError when it is cut short.
    """
    data = content(path)
    if len(data) % _RECORD.itemsize:
        raise AssetError(
            f"the file is cut short: {len(data)} bytes are not a multiple of {_RECORD.itemsize}",
            where=path,
            cure="Copy or export it again.",
        )
    records = np.frombuffer(data, _RECORD)
    colours = records["colour"][:, :3].astype(np.float32) / np.float32(255.0)
    asset = SplatAsset(
        means=records["mean"],
        log_scales=log_scales(records["scale"]),
        quaternions=(records["quaternion"].astype(np.float32) - 128.0) / 128.0,
        logit_opacities=logits_of_bytes(records["colour"][:, 3]),
        sh=((colours - 0.5) / SH_BAND_0)[:, None],
    )
    return asset.finite(path)


FORMAT = SplatFormat(
    suffixes=(".splat",),
    menu=((".splat", "SPLAT", "Small, without colours that depend on the viewing direction"),),
    rank=2,
    magic=(),
    load=load_splat,
    save=save_splat,
    degree=0,
)
