"""Splat assets as PLY files in the layout of the original 3DGS code (docs/formats)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...core.errors import AssetError
from ..asset import SplatAsset
from .compressed_ply import ELEMENTS, is_compressed, unpacked
from .files import publishing
from .ply_vertices import read_elements, read_vertices, vertex_properties
from .record import SplatFormat

_ROWS_AT_ONCE = 1 << 14
"""Few enough to stay in the processor's cache, where columns become rows and rows columns."""

_MOST_REST = 15
"""Coefficients a channel beside the first, of degree 3."""

_FILTER = "filter_3D"
_USUAL_OTHERS = ("red", "green", "blue", "alpha")
"""Of points: an asset's colours are its harmonics."""

LOGIT_OF_1, LOG_SCALE_OF_0 = 17.0, -27.0
"""As ``formats.values`` bounds them: nothing in a picture tells them from infinite ones."""


def save_ply(path: Path, asset: SplatAsset, comments: Sequence[str] = ()) -> None:
    """Write ``asset`` with normals of zero and channel-major ``f_rest``.

    ``comments`` are header lines without the word ``comment``, such as
    ``SplatRenderMode: default``.
    """
    rest_count = 3 * (asset.sh.shape[1] - 1)
    header = ["ply", "format binary_little_endian 1.0"]
    header += [f"comment {line}" for line in comments]
    header += [f"element vertex {len(asset)}"]
    header += [f"property float {name}" for name in _property_names(rest_count)]
    header += ["end_header", ""]
    with path.open("wb") as file:
        file.write("\n".join(header).encode("ascii"))
        for start in range(0, len(asset), _ROWS_AT_ONCE):
            file.write(_rows(asset.subset(slice(start, start + _ROWS_AT_ONCE))).tobytes())


def _rows(asset: SplatAsset) -> np.ndarray:
    """(N, properties) little-endian float32, in the order of ``_property_names``."""
    rest = asset.sh[:, 1:].transpose(0, 2, 1).reshape(len(asset), 3 * (asset.sh.shape[1] - 1))
    columns = [
        asset.means,
        np.zeros_like(asset.means),
        asset.sh[:, 0],
        rest,
        asset.logit_opacities[:, None],
        asset.log_scales,
        asset.quaternions,
    ]
    return np.concatenate(columns, axis=1, dtype="<f4")


def load_ply(path: Path) -> SplatAsset:
    """Read a 3DGS PLY; properties are found by name, so normals and extras may be missing.

    Raises AssetError naming the file and the property or size that is wrong; of the values
    see ``from_vertices``.
    """
    return from_vertices(read_vertices(path), path)


def load_made(path: Path) -> SplatAsset:
    """The same of a file that a step of a scene made: where it is damaged, the step makes it again."""
    try:
        return load_ply(path)
    except AssetError as error:
        if isinstance(error.__cause__, PermissionError):
            raise
        raise AssetError(error.what, where=error.where, cure="Run `r2sego refine` again.") from error


def from_vertices(vertices: np.ndarray, path: Path) -> SplatAsset:
    """The asset of a 3DGS PLY's vertices, as ``read_vertices`` returns them.

    Gaussians with a value that is not finite are dropped, but for what other programs mean by
    infinity: opacities of 1 and scales of 0. Without the third scale (2DGS) they are discs as
    thin as a thousandth of their smaller radius. Of degree 4 the degrees up to 3 are taken. The 3D smoothing
    filter of Mip-Splatting, ``filter_3D``, goes into scales and opacities.
    """
    names = vertices.dtype.names or ()

    def columns(*wanted: str) -> np.ndarray:
        for name in wanted:
            if name not in names:
                raise AssetError(
                    f"the property '{name}' is missing", where=path, cure="Export it as a 3DGS PLY with all properties."
                )
        values = np.empty((len(vertices), len(wanted)), np.float32)
        for start in range(0, len(vertices), _ROWS_AT_ONCE):
            rows = slice(start, start + _ROWS_AT_ONCE)
            for k, name in enumerate(wanted):
                values[rows, k] = vertices[name][rows]
        return values

    rest_count = sum(name.startswith("f_rest_") for name in names)
    stored = rest_count // 3
    if rest_count % 3 or stored + 1 not in (1, 4, 9, 16, 25):
        raise AssetError(
            f"there are {rest_count} f_rest properties", where=path, cure="Degrees 0 to 4 have 0, 9, 24, 45 or 72."
        )
    kept = min(stored, _MOST_REST)
    harmonics = [f"f_dc_{channel}" for channel in range(3)]
    harmonics += [f"f_rest_{channel * stored + k}" for k in range(kept) for channel in range(3)]
    log_scales = columns("scale_0", "scale_1", *(["scale_2"] if "scale_2" in names else []))
    if log_scales.shape[1] == 2:
        thin = log_scales.min(axis=1, keepdims=True) - np.float32(np.log(1000.0))
        log_scales = np.concatenate([log_scales, thin], axis=1)
    log_scales[np.isneginf(log_scales)] = LOG_SCALE_OF_0
    logit_opacities = columns("opacity")[:, 0]
    logit_opacities[np.isposinf(logit_opacities)] = LOGIT_OF_1
    if _FILTER in names:
        log_scales, logit_opacities = _filtered(log_scales, logit_opacities, columns(_FILTER)[:, 0])
    return SplatAsset(
        means=columns("x", "y", "z"),
        log_scales=log_scales,
        quaternions=columns(*(f"rot_{k}" for k in range(4))),
        logit_opacities=logit_opacities,
        sh=columns(*harmonics).reshape(len(vertices), kept + 1, 3),
    ).finite(path)


def _filtered(
    log_scales: np.ndarray, logit_opacities: np.ndarray, filter_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gaussians convolved with an isotropic one of standard deviation (N,) metres, which keep their mass.

    Yu et al., Mip-Splatting (2024), eq. 9; other programs render what such a file holds without it wrongly.
    """
    filter_m = np.abs(filter_m.astype(np.float64))
    with np.errstate(divide="ignore"):  # no filter, and opacities of 0
        wider = 0.5 * np.logaddexp(2.0 * log_scales, 2.0 * np.log(filter_m)[:, None])
        log_opacities = -np.logaddexp(0.0, -logit_opacities.astype(np.float64)) + (log_scales - wider).sum(axis=1)
        logits = np.minimum(log_opacities - np.log(-np.expm1(log_opacities)), logit_opacities)
    none = filter_m == 0.0
    return np.where(none[:, None], log_scales, wider), np.where(none, logit_opacities, logits)


def unread_properties(path: Path) -> list[str]:
    """Those of a PLY's vertices that no asset has, such as another program's own; they may change its pictures."""
    read = {*_property_names(0), *_USUAL_OTHERS, _FILTER}
    names = vertex_properties(path)
    return [name for name in names if name not in read and not name.startswith(("f_rest_", "packed_"))]


def _property_names(rest_count: int) -> list[str]:
    names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"]
    names += [f"f_rest_{k}" for k in range(rest_count)]
    return [*names, "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]


def _load(path: Path) -> SplatAsset:
    """Ours, or the compressed one of SuperSplat."""
    elements = read_elements(path, ELEMENTS)
    return unpacked(elements, path) if is_compressed(elements) else from_vertices(elements["vertex"], path)


def _save(path: Path, asset: SplatAsset) -> None:
    with publishing(path) as staging:
        save_ply(staging, asset.finite())


FORMAT = SplatFormat(
    suffixes=(".ply",),
    menu=((".ply", "PLY", "All attributes, to the bit: the layout of the original 3D Gaussian splatting"),),
    rank=0,
    magic=(b"ply\n", b"ply\r"),
    load=_load,
    save=_save,
    unread=unread_properties,
)
