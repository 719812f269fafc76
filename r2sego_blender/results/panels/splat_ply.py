"""What Blender shows of a splat file: centres, sizes, turns, opacities and plain colours. No bpy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...bundle.asset_stages import Stage
from ...core.errors import AssetError
from ...splats.asset import LARGEST, usable
from ...splats.formats.ply import LOG_SCALE_OF_0, LOGIT_OF_1
from ...splats.formats.ply_vertices import read_vertices
from ...splats.harmonics import SH_BAND_0
from ...splats.quaternions import of_usable_length

_SH_BAND_0 = np.float32(SH_BAND_0)
_THIN = np.float32(np.log(1000.0))
_MIX = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)


@dataclass(frozen=True)
class ShownSplats:
    """N splats, float32: ``means`` (N, 3) metres in the world, ``log_scales`` (N, 3) of the standard
    deviations in metres, ``quaternions`` (N, 4) wxyz, ``opacities`` (N,) and ``colours`` (N, 3) in
    [0, 1], sRGB, averaged over all directions. ``backdrop`` (N,) bool: which stand far behind the
    room, where no photograph shows anything.
    """

    means: np.ndarray
    log_scales: np.ndarray
    quaternions: np.ndarray
    opacities: np.ndarray
    colours: np.ndarray
    backdrop: np.ndarray

    def __len__(self) -> int:
        return len(self.means)

    @property
    def radii_m(self) -> np.ndarray:
        """(N,) float32: one standard deviation of a disc as large as the splat seen from its flat side."""
        return np.exp((self.log_scales.sum(axis=1) - self.log_scales.min(axis=1)) / 2.0)

    def concatenated(self, other: ShownSplats) -> ShownSplats:
        """These splats, then the others."""
        return ShownSplats(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in _FIELDS))


_FIELDS = tuple(ShownSplats.__dataclass_fields__)


def read_splats(path: Path, backdrop: bool = False) -> ShownSplats:
    """Read a 3DGS PLY as the engine does, without what depends on the viewing direction.

    Splats that ``usable`` does not name are dropped. Raises AssetError naming the file and
    the property or size that is wrong.
    """
    vertices = read_vertices(path)
    names = vertices.dtype.names or ()

    def columns(*wanted: str) -> np.ndarray:
        for name in wanted:
            if name not in names:
                raise AssetError(
                    f"the property '{name}' is missing", where=path, cure="Export it as a 3DGS PLY with all properties."
                )
        return np.stack([vertices[name].astype(np.float32) for name in wanted], axis=1)

    means = columns("x", "y", "z")
    if "scale_2" in names:
        log_scales = columns("scale_0", "scale_1", "scale_2")
    else:
        flat = columns("scale_0", "scale_1")
        log_scales = np.concatenate([flat, flat.min(axis=1, keepdims=True) - _THIN], axis=1)
    quaternions = columns("rot_0", "rot_1", "rot_2", "rot_3")
    logits = columns("opacity")[:, 0]
    dc = columns("f_dc_0", "f_dc_1", "f_dc_2")
    log_scales[np.isneginf(log_scales)], logits[np.isposinf(logits)] = LOG_SCALE_OF_0, LOGIT_OF_1
    finite = usable(means, log_scales, quaternions, logits, dc)
    for name in names:
        if name.startswith("f_rest_"):
            finite &= np.abs(vertices[name]) <= LARGEST
    opacities = (1.0 / (1.0 + np.exp(-np.clip(logits, -80.0, 80.0)))).astype(np.float32)
    colours = np.clip(dc * _SH_BAND_0 + np.float32(0.5), 0.0, 1.0)
    parts = (means, log_scales, quaternions, opacities, colours, np.full(len(means), backdrop))
    means, log_scales, quaternions, *rest = parts if finite.all() else (values[finite] for values in parts)
    return ShownSplats(means, log_scales, of_usable_length(quaternions), *rest)


def read_stage(stage: Stage, backdrop: Path | None) -> ShownSplats:
    """The splats of a bundle's asset, those of the backdrop marked.

    A round's asset gets the backdrop behind it; the final one holds it already: there its splats
    are those at the places of the file ``backdrop``. Raises AssetError for a damaged file.
    """
    shown = read_splats(stage.file)
    if stage.backdrop is not None:
        return shown.concatenated(read_splats(stage.backdrop, backdrop=True))
    if backdrop is not None and backdrop.is_file():
        shown.backdrop[:] = np.isin(_places(shown.means), _places(read_splats(backdrop).means))
    return shown


def _places(means: np.ndarray) -> np.ndarray:
    """(N,) uint64: a number for each point (N, 3) float32, of all its bits."""
    bits = np.ascontiguousarray(means, np.float32).view(np.uint32).astype(np.uint64)
    return (bits[:, 0] * _MIX[0]) ^ (bits[:, 1] * _MIX[1]) ^ (bits[:, 2] * _MIX[2])
