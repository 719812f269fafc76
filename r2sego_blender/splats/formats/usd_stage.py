"""Reads the splats of a USD stage into arrays: ``python usd_stage.py STAGE ARRAYS.npz``.

A program of its own, with no import of this package: OpenUSD may end the process on a
damaged binary file, and then ends this one alone. Its time and, on Linux, its memory are bounded by
the size of the stage's files, and nothing outside of the stage's folder is opened.
"""

from __future__ import annotations

import faulthandler
import sys
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pxr import Sdf, Usd

PRIM_TYPE = "ParticleField3DGaussianSplat"
_HIGHEST_DEGREE = 4
_COEFFICIENTS = 16
"""Of the degrees up to 3; what a higher degree adds is left out."""

_LEAST_ROOM = 96 << 20
_MOST_TIMES, _MOST_TIMES_OF_TEXT = 10, 32
"""Bytes that any stage may take, and times the size of its files that larger ones may: of text OpenUSD makes
27 times as much while it reads it, of binary files hardly more than they have."""
_BINARY = b"PXR-USDC"
_LEAST_TIME_S = 10.0
_BYTES_A_SECOND = 1 << 20
_MOST_PRIMS, _MOST_SPLAT_PRIMS = 1 << 20, 4096


class _RefusalError(Exception):
    """What the stage may not do, in words."""


def main(stage_path: str, arrays_path: str) -> None:
    """Write, for the k-th prim of splats, its arrays as ``k.name``, and what the stage says of its frame.

    Of a stage that is refused ``refusal`` alone, which says why.
    """
    try:
        arrays = _read(stage_path)
    except _RefusalError as refusal:
        arrays = {"refusal": str(refusal)}
    np.savez(arrays_path, **arrays)


def _read(stage_path: str) -> dict:
    from pxr import Usd, UsdGeom

    room = _looked_over(stage_path)
    first = Usd.TimeCode.EarliestTime()
    stage = Usd.Stage.Open(stage_path)
    transforms = UsdGeom.XformCache(first)
    arrays = {
        "y_up": UsdGeom.GetStageUpAxis(stage) != UsdGeom.Tokens.z,
        "metres_per_unit": UsdGeom.GetStageMetersPerUnit(stage),
    }
    count = 0
    for number, prim in enumerate(stage.Traverse(Usd.TraverseInstanceProxies())):
        if number == _MOST_PRIMS:
            raise _RefusalError(f"the stage has more than {_MOST_PRIMS} prims")
        if prim.GetTypeName() == PRIM_TYPE:
            stage_from_prim = np.array(transforms.GetLocalToWorldTransform(prim)).T
            for name, values in {"stage_from_prim": stage_from_prim, **_gaussians(prim, first)}.items():
                arrays[f"{count}.{name}"] = values
                room -= values.nbytes
            count += 1
            if room < 0 or count > _MOST_SPLAT_PRIMS:
                raise _RefusalError(f"the stage shows more splats than its files can hold, or {count} prims of them")
    return {"count": count, **arrays}


def _looked_over(stage_path: str) -> int:
    """The bytes that reading the stage may take, once each file that it is composed of was opened by itself.

    Raises _RefusalError for one outside of the stage's folder.
    """
    from pxr import Ar, Sdf

    resolver = Ar.GetResolver()
    folder = Path(stage_path).resolve().parent
    files = {Path(stage_path)}
    room = _bounded(files, 0)
    seen: set[str] = set()
    waiting = [Sdf.Layer.FindOrOpen(stage_path)]
    while waiting:
        layer = waiting.pop()
        if layer is None or layer.identifier in seen:  # what cannot be opened composes nothing
            continue
        seen.add(layer.identifier)
        _refuse_clips(layer)
        for named in layer.GetCompositionAssetDependencies():
            name, arguments = Sdf.Layer.SplitIdentifier(named)
            found = resolver.Resolve(resolver.CreateIdentifier(name, layer.resolvedPath)).GetPathString()
            file = Path(Ar.SplitPackageRelativePathOuter(found)[0])
            is_inside = file.resolve().is_relative_to(folder) if found else "`" not in named
            if not is_inside or arguments:
                raise _RefusalError(f"the stage refers to '{named}', which is not in the file's folder")
            if found:
                if file not in files:
                    files.add(file)
                    room = _bounded(files, room)
                waiting.append(Sdf.Layer.FindOrOpenRelativeToLayer(layer, name))
    return room


def _refuse_clips(layer: Sdf.Layer) -> None:
    """Raises _RefusalError for value clips, whose files are named by patterns: the first sample is all we take."""
    clips: list[str] = []

    def look(path: Sdf.Path) -> None:
        is_prim = path.IsPrimPath() or path.IsPrimVariantSelectionPath()
        if is_prim and layer.GetObjectAtPath(path).HasInfo("clips"):
            clips.append(str(path))

    layer.Traverse("/", look)
    if clips:
        raise _RefusalError(f"the prim {clips[0]} takes its values from clips")


def _bounded(files: Collection[Path], before: int) -> int:
    """The bytes that may be taken from here on, which with the time bound the whole process.

    ``before`` is what was allowed already.
    """
    file_bytes = sum(file.stat().st_size for file in files)
    faulthandler.dump_traceback_later(_LEAST_TIME_S + file_bytes / _BYTES_A_SECOND, exit=True)
    room = _LEAST_ROOM
    for file in files:
        with file.open("rb") as stream:
            is_binary = stream.read(len(_BINARY)) == _BINARY
        room += file.stat().st_size * (_MOST_TIMES if is_binary else _MOST_TIMES_OF_TEXT)
    if sys.platform == "linux" and room > before:
        import resource

        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        used_kib = next(int(line.split()[1]) for line in lines if line.startswith("VmData:"))
        most = resource.getrlimit(resource.RLIMIT_DATA)[1]
        resource.setrlimit(resource.RLIMIT_DATA, (used_kib * 1024 + room, most))
    return room


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
