"""Splat assets as PLY files in the layout of the original 3DGS code (docs/formats)."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import AssetError
from .asset import SplatAsset

_SCALARS = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER = 1 << 20


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
    try:
        data = path.read_bytes()
    except OSError as error:
        raise AssetError("the splat file cannot be read", where=path, cure="Check the path.") from error
    vertices = _vertices(data, path)
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


def _vertices(data: bytes, path: Path) -> np.ndarray:
    """The vertex element as a structured array."""
    end = data.find(b"end_header", 0, _LONGEST_HEADER)
    if not data.startswith(b"ply") or end < 0:
        raise AssetError("the file is not a PLY", where=path, cure="Give a 3DGS .ply file.")
    body = data.find(b"\n", end) + 1
    order, count, fields = "", None, []
    element = ""
    for line in data[:end].decode("latin-1").splitlines():
        words = line.split()
        match words[:1]:
            case ["format"]:
                order = words[1] if len(words) > 1 else ""
            case ["element"] if len(words) == 3 and words[2].isdigit():
                element = words[1]
                if element == "vertex":
                    count = int(words[2])
                elif count is None and int(words[2]) > 0:
                    raise AssetError(
                        f"the element '{element}' stands before the vertices",
                        where=path, cure="Export the splats alone.",
                    )  # fmt: skip
            case ["property"] if element == "vertex":
                if len(words) != 3 or words[1] not in _SCALARS:
                    raise AssetError(
                        f"the line '{line.strip()}' is no scalar property",
                        where=path,
                        cure="Export it as a 3DGS PLY.",
                    )
                fields.append((words[2], _SCALARS[words[1]]))
    if count is None or not fields or len({name for name, _ in fields}) < len(fields):
        raise AssetError(
            "the header has no usable vertex element", where=path, cure="Export it as a 3DGS PLY."
        )
    if order == "ascii":
        return _ascii_vertices(data[body:], count, fields, path)
    if order not in _BYTE_ORDERS:
        raise AssetError(f"the format '{order}' is unknown", where=path, cure="Use binary_little_endian.")
    layout = np.dtype([(name, _BYTE_ORDERS[order] + kind) for name, kind in fields])
    if len(data) - body < count * layout.itemsize:
        raise AssetError(
            f"the file is cut short: {count} Gaussians need {count * layout.itemsize} bytes "
            f"and {len(data) - body} are there",
            where=path, cure="Copy or export it again.",
        )  # fmt: skip
    return np.frombuffer(data, layout, count, body)


def _ascii_vertices(text: bytes, count: int, fields: list[tuple[str, str]], path: Path) -> np.ndarray:
    layout = np.dtype([(name, "f4") for name, _ in fields])
    try:
        values = np.loadtxt(io.BytesIO(text), np.float32, max_rows=count, ndmin=2)
    except ValueError as error:
        raise AssetError("the text of the file is damaged", where=path, cure="Export it again.") from error
    if values.shape != (count, len(fields)) and count > 0:
        raise AssetError(
            f"the file has {values.shape} numbers, not {(count, len(fields))}",
            where=path,
            cure="Export it again.",
        )
    return np.ascontiguousarray(values).reshape(count, len(fields)).view(layout)[:, 0]
