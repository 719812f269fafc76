"""Reads the splats of a USD stage into arrays: ``python usd_stage.py STAGE ARRAYS.npz``.

A program of its own, with no import of this package: OpenUSD may end the process on a
damaged binary file, and then ends this one alone.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pxr import Usd

PRIM_TYPE = "ParticleField3DGaussianSplat"
_HIGHEST_DEGREE = 4
_COEFFICIENTS = 16
"""Of the degrees up to 3; what a higher degree adds is left out."""


def main(stage_path: str, arrays_path: str) -> None:
    """Write, for the k-th prim of splats, its arrays as ``k.name``, and what the stage says of its frame."""
    from pxr import Usd, UsdGeom

    first = Usd.TimeCode.EarliestTime()
    stage = Usd.Stage.Open(stage_path)
    transforms = UsdGeom.XformCache(first)
    arrays = {
        "y_up": UsdGeom.GetStageUpAxis(stage) != UsdGeom.Tokens.z,
        "metres_per_unit": UsdGeom.GetStageMetersPerUnit(stage),
    }
    prims = [p for p in stage.Traverse(Usd.TraverseInstanceProxies()) if p.GetTypeName() == PRIM_TYPE]
    for k, prim in enumerate(prims):
        stage_from_prim = np.array(transforms.GetLocalToWorldTransform(prim)).T
        for name, values in {"stage_from_prim": stage_from_prim, **_gaussians(prim, first)}.items():
            arrays[f"{k}.{name}"] = values
    np.savez(arrays_path, count=len(prims), **arrays)


def _gaussians(prim: Usd.Prim, first: Usd.TimeCode) -> dict[str, np.ndarray]:
    """Float32 arrays of one prim in its own frame; what is absent or too short has the schema's default."""

    def values(name: str, rows: int | None, default: np.ndarray) -> np.ndarray:
        for attribute in (name, f"{name}h"):  # the schema prefers float to half
            value = prim.GetAttribute(attribute).Get(first)
            if value is not None and (rows is None or len(value) >= rows):
                return np.array(value, np.float32).reshape(len(value), *default.shape)[:rows]
        return np.broadcast_to(default, (rows or 0, *default.shape))

    degree = prim.GetAttribute("radiance:sphericalHarmonicsDegree").Get()
    if not 0 <= degree <= _HIGHEST_DEGREE:
        raise ValueError(f"harmonics of degree {degree}")
    positions = values("positions", None, np.zeros(3))
    count, coefficients = len(positions), (degree + 1) ** 2
    harmonics = values("radiance:sphericalHarmonicsCoefficients", count * coefficients, np.zeros(3))
    return {
        "positions": positions,
        "scales": values("scales", count, np.ones(3)),
        # Arrays of Gf.Quatf hold the real part last, whatever the text of a file shows.
        "orientations_xyzw": values("orientations", count, np.array([0.0, 0.0, 0.0, 1.0])),
        "opacities": values("opacities", count, np.ones(())),
        "sh": harmonics.reshape(count, coefficients, 3)[:, :_COEFFICIENTS],
    }


if __name__ == "__main__":
    main(*sys.argv[1:])
