"""Splat assets as PLY files in the layout of the original 3DGS code (docs/formats)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import AssetError
from .asset import SplatAsset
from .ply_vertices import read_vertices


def save_ply(path: Path, asset: SplatAsset, comments: Sequence[str] = ()) -> None:
    """Write ``asset`` with normals of zero and channel-major ``f_rest``.

    ``comments`` are header lines without the word ``comment``, such as
    ``SplatRenderMode: default``.
    """
    rest = asset.sh[:, 1:].transpose(0, 2, 1).reshape(len(asset), 3 * (asset.sh.shape[1] - 1))
    columns = np.concatenate(
        [
            asset.means,
            np.zeros_like(asset.means),
            asset.sh[:, 0],
            rest,
            asset.logit_opacities[:, None],
            asset.log_scales,
            asset.quaternions,
        ],
        axis=1,
    )
    header = ["ply", "format binary_little_endian 1.0"]
    header += [f"comment {line}" for line in comments]
    header += [f"element vertex {len(asset)}"]
    header += [f"property float {name}" for name in _property_names(rest.shape[1])]
    header += ["end_header", ""]
    path.write_bytes("\n".join(header).encode("ascii") + columns.astype("<f4").tobytes())


def load_ply(path: Path) -> SplatAsset:
    """Read a 3DGS PLY; properties are found by name, so normals and extras may be missing.

    Gaussians with a value that is not finite are dropped. A file without the third scale
    (2DGS) gets discs as thin as a thousandth of their smaller radius. Raises AssetError
    naming the file and the property or size that is wrong.
    """
    vertices = read_vertices(path)
    names = vertices.dtype.names or ()

    def column(name: str) -> np.ndarray:
        if name not in names:
            raise AssetError(
                f"the property '{name}' is missing",
                where=path,
                cure="Export it as a 3DGS PLY with all properties.",
            )
        return vertices[name].astype(np.float32)

    rest_count = sum(name.startswith("f_rest_") for name in names)
    coefficients = rest_count // 3 + 1
    if rest_count % 3 or coefficients not in (1, 4, 9, 16):
        raise AssetError(
            f"there are {rest_count} f_rest properties",
            where=path,
            cure="Degrees 0 to 3 have 0, 9, 24 or 45.",
        )
    scales = [column("scale_0"), column("scale_1")]
    thin = np.minimum(*scales) - np.float32(np.log(1000.0))
    scales.append(column("scale_2") if "scale_2" in names else thin)
    sh = np.empty((len(vertices), coefficients, 3), np.float32)
    for channel in range(3):
        sh[:, 0, channel] = column(f"f_dc_{channel}")
        for k in range(1, coefficients):
            sh[:, k, channel] = column(f"f_rest_{channel * (coefficients - 1) + k - 1}")
    asset = SplatAsset(
        means=np.stack([column(name) for name in "xyz"], axis=1),
        log_scales=np.stack(scales, axis=1),
        quaternions=np.stack([column(f"rot_{k}") for k in range(4)], axis=1),
        logit_opacities=column("opacity"),
        sh=sh,
    )
    finite = np.isfinite(asset.logit_opacities)
    for values in (
        asset.means,
        asset.log_scales,
        asset.quaternions,
        asset.sh.reshape(len(asset), 3 * coefficients),
    ):
        finite &= np.isfinite(values).all(axis=1)
    return asset if finite.all() else asset.subset(finite)


def _property_names(rest_count: int) -> list[str]:
    names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"]
    names += [f"f_rest_{k}" for k in range(rest_count)]
    return [*names, "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
