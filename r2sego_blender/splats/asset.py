"""The visual asset A: a set of 3D Gaussians with view-dependent colour (Kerbl et al. 2023)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..core.errors import AssetError
from .harmonics import SH_BAND_0, degree_of, rotated_coefficients
from .quaternions import from_rotation, of_usable_length, product

LARGEST = 1e9
"""Of means, metres, harmonics and opacities: beyond it products of a few are infinite in float32, and so is
what is rendered of them."""

LARGEST_LOG_SCALE = 80.0
"""Standard deviations that fit into float32."""

_WIDTHS = {"means": 3, "log_scales": 3, "quaternions": 4}


@dataclass(frozen=True)
class SplatAsset:
    """N Gaussians in the world frame, float32 and contiguous.

    ``means`` (N, 3) metres; ``log_scales`` (N, 3) natural logarithms of the standard
    deviations in metres; ``quaternions`` (N, 4) wxyz, of any length (zero counts as the
    identity); ``logit_opacities`` (N,); ``sh`` (N, (D+1)**2, 3) coefficients of the real
    spherical harmonics of degree D from 0 to 3, in 3DGS order and sign. Raises AssetError
    when the shapes do not fit together.
    """

    means: np.ndarray
    log_scales: np.ndarray
    quaternions: np.ndarray
    logit_opacities: np.ndarray
    sh: np.ndarray

    def __post_init__(self) -> None:
        for name in ("means", "log_scales", "quaternions", "logit_opacities", "sh"):
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), np.float32))
        count = len(self.means)
        shapes: dict[str, tuple[int, ...]] = {name: (count, width) for name, width in _WIDTHS.items()}
        shapes |= {"logit_opacities": (count,), "sh": (count, *self.sh.shape[1:2], 3)}
        for name, expected in shapes.items():
            found = getattr(self, name).shape
            if found != expected:
                raise AssetError(
                    f"{name} has the shape {found}, not {expected}", cure="Give one row for each Gaussian."
                )
        if self.sh.shape[1] not in (1, 4, 9, 16):
            raise AssetError(
                f"sh has {self.sh.shape[1]} coefficients a channel", cure="Degrees 0 to 3 have 1, 4, 9 or 16."
            )

    def __len__(self) -> int:
        return len(self.means)

    @property
    def degree(self) -> int:
        """The degree D of the spherical harmonics."""
        return degree_of(self.sh.shape[1])

    @property
    def opacities(self) -> np.ndarray:
        """(N,) float32 in [0, 1]."""
        return (1.0 / (1.0 + np.exp(-np.clip(self.logit_opacities, -80.0, 80.0)))).astype(np.float32)

    @property
    def base_colours(self) -> np.ndarray:
        """(N, 3) float32, the colour averaged over all directions; not clipped."""
        return self.sh[:, 0] * np.float32(SH_BAND_0) + np.float32(0.5)

    def transformed(self, similarity: np.ndarray) -> SplatAsset:
        """The asset moved by a (4, 4) similarity ``new_from_old``; the harmonics turn with it.

        Raises AssetError when the matrix shears, mirrors or scales unevenly.
        """
        linear = np.asarray(similarity, np.float64)[:3, :3]
        determinant = np.linalg.det(linear)
        scale = np.cbrt(determinant)
        if determinant <= 0 or not np.allclose(linear @ linear.T, scale**2 * np.eye(3), atol=1e-5 * scale**2):
            raise AssetError("the transform is not a similarity", cure="Use a rotation, one scale and a translation.")
        rotation = linear / scale
        return SplatAsset(
            means=self.means.astype(np.float64) @ linear.T + np.asarray(similarity)[:3, 3],
            log_scales=self.log_scales + np.float32(np.log(scale)),
            quaternions=product(from_rotation(rotation), _with_identity(self.quaternions)),
            logit_opacities=self.logit_opacities,
            sh=rotated_coefficients(self.sh, rotation),
        )

    def concatenated(self, *others: SplatAsset) -> SplatAsset:
        """This asset's Gaussians, then the others', at the highest of their degrees."""
        if not others:
            return self
        degree = max(one.degree for one in (self, *others))
        assets = [one.with_degree(degree) for one in (self, *others)]
        return SplatAsset(
            means=np.concatenate([one.means for one in assets]),
            log_scales=np.concatenate([one.log_scales for one in assets]),
            quaternions=np.concatenate([one.quaternions for one in assets]),
            logit_opacities=np.concatenate([one.logit_opacities for one in assets]),
            sh=np.concatenate([one.sh for one in assets]),
        )

    def subset(self, chosen: np.ndarray | slice) -> SplatAsset:
        """The Gaussians of a slice, an index array or a (N,) bool mask, in that order."""
        return SplatAsset(
            means=self.means[chosen],
            log_scales=self.log_scales[chosen],
            quaternions=self.quaternions[chosen],
            logit_opacities=self.logit_opacities[chosen],
            sh=self.sh[chosen],
        )

    def finite(self, file: Path | None = None) -> SplatAsset:
        """The asset without the Gaussians that ``usable`` does not name, its quaternions of usable length.

        Raises AssetError naming ``file``, where one is given, if that leaves none of them.
        """
        parts = (self.means, self.log_scales, self.quaternions, self.logit_opacities, self.sh)
        if all(_is_bounded(values, bound) for values, bound in zip(parts, _BOUNDS, strict=True)):
            kept = self  # looked at whole in a fraction of the time
        else:
            keep = usable(*parts)
            if file is not None and len(self) and not keep.any():
                raise AssetError(
                    "no Gaussian of the file has finite values, none of them beyond all bounds",
                    where=file,
                    cure="Copy or export it again.",
                )
            kept = self if keep.all() else self.subset(keep)
        quaternions = of_usable_length(kept.quaternions)
        return kept if quaternions is kept.quaternions else replace(kept, quaternions=quaternions)

    def with_degree(self, degree: int) -> SplatAsset:
        """The asset at another degree: harmonics cut off, or zeros appended."""
        coefficients = (degree + 1) ** 2
        sh = np.zeros((len(self), coefficients, 3), np.float32)
        shared = min(coefficients, self.sh.shape[1])
        sh[:, :shared] = self.sh[:, :shared]
        return SplatAsset(self.means, self.log_scales, self.quaternions, self.logit_opacities, sh)

    def copy(self) -> SplatAsset:
        """An asset that shares no memory with this one."""
        return SplatAsset(
            self.means.copy(),
            self.log_scales.copy(),
            self.quaternions.copy(),
            self.logit_opacities.copy(),
            self.sh.copy(),
        )

    @staticmethod
    def empty(degree: int = 0) -> SplatAsset:
        """An asset without Gaussians."""
        return SplatAsset(
            means=np.zeros((0, 3)),
            log_scales=np.zeros((0, 3)),
            quaternions=np.zeros((0, 4)),
            logit_opacities=np.zeros(0),
            sh=np.zeros((0, (degree + 1) ** 2, 3)),
        )


_LARGEST_LENGTH = float(np.finfo(np.float32).max)
_BOUNDS = (
    (-LARGEST, LARGEST),
    (-LARGEST, LARGEST_LOG_SCALE),
    (-_LARGEST_LENGTH, _LARGEST_LENGTH),
    (-LARGEST, LARGEST),
    (-LARGEST, LARGEST),
)
"""Of an asset's means, log_scales, quaternions, logit_opacities and sh."""


def usable(
    means: np.ndarray, log_scales: np.ndarray, quaternions: np.ndarray, logit_opacities: np.ndarray, sh: np.ndarray
) -> np.ndarray:
    """(N,) bool: which Gaussians have finite values alone, none of them beyond LARGEST or LARGEST_LOG_SCALE."""
    keep = np.ones(len(means), bool)
    for values, (low, high) in zip((means, log_scales, quaternions, logit_opacities, sh), _BOUNDS, strict=True):
        keep &= ((values >= low) & (values <= high)).all(axis=tuple(range(1, values.ndim)))
    return keep


def _is_bounded(values: np.ndarray, bounds: tuple[float, float]) -> bool:
    """Whether all values lie within; no number does not."""
    return not values.size or bool(values.min() >= bounds[0] and values.max() <= bounds[1])


def _with_identity(quaternions: np.ndarray) -> np.ndarray:
    zero = np.linalg.norm(quaternions, axis=1) < 1e-12
    return np.where(zero[:, None], np.array([1.0, 0.0, 0.0, 0.0]), quaternions)
