"""The compressed PLY of SuperSplat and PlayCanvas: sixteen bytes a Gaussian beside its harmonics.

Positions, scales and colours are fractions of the bounds of their chunk, 256 Gaussians each.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...core.errors import AssetError
from ..asset import SplatAsset
from ..harmonics import SH_BAND_0
from .values import logits_of_bytes

ELEMENTS = ("chunk", "vertex", "sh")

_CHUNK = 256
_RECIPE_11_10_11 = ((21, 11), (11, 10), (0, 11))
"""First bit and number of bits of x, y and z."""
_RECIPE_8_8_8 = ((24, 8), (16, 8), (8, 8))
_RECIPE_10_10_10 = ((20, 10), (10, 10), (0, 10))
_OTHER_COMPONENTS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
_LARGEST_HARMONIC = 4.0
_DEGREES = (0, 9, 24, 45)


def is_compressed(elements: dict[str, np.ndarray]) -> bool:
    """Whether a PLY's elements are those of this format."""
    return "chunk" in elements and "packed_position" in (elements["vertex"].dtype.names or ())


def unpacked(elements: dict[str, np.ndarray], path: Path) -> SplatAsset:
    """The asset of a compressed PLY's elements. Raises AssetError naming what is missing."""
    chunks, vertices = elements["chunk"], elements["vertex"]
    if len(chunks) * _CHUNK < len(vertices):
        raise AssetError(
            f"there are {len(chunks)} chunks for {len(vertices)} Gaussians", where=path, cure="Export it again."
        )
    chunk_of = np.arange(len(vertices)) // _CHUNK

    def within(name: str, recipe: tuple, axes: str, bounds: str) -> np.ndarray:
        share = _fractions(_column(vertices, name, path), recipe)
        low, high = (
            np.stack([_column(chunks, f"{end}_{bounds}{axis}", path) for axis in axes], axis=1)[chunk_of]
            for end in ("min", "max")
        )
        return low * (1.0 - share) + high * share

    packed_colour = _column(vertices, "packed_color", path)
    if "min_r" in (chunks.dtype.names or ()):
        colours = within("packed_color", _RECIPE_8_8_8, "rgb", "")
    else:
        colours = _fractions(packed_colour, _RECIPE_8_8_8)
    base = ((colours - 0.5) / SH_BAND_0).astype(np.float32)
    return SplatAsset(
        means=within("packed_position", _RECIPE_11_10_11, "xyz", ""),
        log_scales=within("packed_scale", _RECIPE_11_10_11, "xyz", "scale_"),
        quaternions=_rotations(_column(vertices, "packed_rotation", path)),
        logit_opacities=logits_of_bytes(packed_colour & 255),
        sh=np.concatenate([base[:, None], _harmonics(elements.get("sh"), len(vertices), path)], axis=1),
    ).finite(path)


def _column(rows: np.ndarray, name: str, path: Path) -> np.ndarray:
    if name not in (rows.dtype.names or ()):
        raise AssetError(f"the property '{name}' is missing", where=path, cure="Export it again.")
    kind = np.uint32 if name.startswith("packed_") else np.float32
    return rows[name].astype(kind)


def _fractions(packed: np.ndarray, recipe: tuple[tuple[int, int], ...]) -> np.ndarray:
    """(N, len(recipe)) float32 in [0, 1]."""
    fields = [(packed >> np.uint32(first) & (2**bits - 1)) / (2.0**bits - 1.0) for first, bits in recipe]
    return np.stack(fields, axis=1).astype(np.float32)


def _rotations(packed: np.ndarray) -> np.ndarray:
    """(N, 4) wxyz: the largest component's place in 2 bits, the others in 10 each."""
    others = (_fractions(packed, _RECIPE_10_10_10) - 0.5) * 2.0**0.5
    largest = (packed >> np.uint32(30)).astype(np.intp)
    quaternions = np.empty((len(packed), 4), np.float32)
    np.put_along_axis(quaternions, _OTHER_COMPONENTS[largest], others, axis=1)
    missing = np.sqrt(np.maximum(1.0 - (others**2).sum(axis=1, keepdims=True), 0.0))
    np.put_along_axis(quaternions, largest[:, None], missing, axis=1)
    return quaternions


def _harmonics(rows: np.ndarray | None, count: int, path: Path) -> np.ndarray:
    """(N, K, 3) float32 of the bytes of ``f_rest``, the middle of what rounds to them."""
    stored = 0 if rows is None else len(rows.dtype.names or ())
    if stored not in _DEGREES or (rows is not None and stored and len(rows) != count):
        raise AssetError(
            f"the element 'sh' has {stored} properties of {0 if rows is None else len(rows)} Gaussians",
            where=path,
            cure="Export it again.",
        )
    harmonics = np.empty((count, stored // 3, 3), np.float32)
    for k in range(stored):
        assert rows is not None
        values = _column(rows, f"f_rest_{k}", path)
        share = np.where(values == 0.0, 0.0, np.where(values == 255.0, 1.0, (values + 0.5) / 256.0))
        channel, coefficient = divmod(k, stored // 3)
        harmonics[:, coefficient, channel] = (share - 0.5) * 2.0 * _LARGEST_HARMONIC
    return harmonics
