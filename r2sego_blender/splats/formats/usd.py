"""Assets as OpenUSD particle fields (``ParticleField3DGaussianSplat``, OpenUSD 26.03)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...core.arrays import opened_arrays
from ...core.errors import AssetError
from ...core.scratch import ScratchFolder
from ..asset import SplatAsset
from ..quaternions import to_rotation, unit_quaternions
from . import usd_stage
from .files import content, publishing
from .record import SplatFormat
from .values import WORLD_FROM_Y_UP, in_world, linear_scales, log_scales, logits

if TYPE_CHECKING:
    from pxr import Usd

_DEGREES = (0, 3)
"""Those that importers take: with others Isaac Sim's never ends."""
_EXTENT_SIGMAS = 3.0
"""As far as the schema says a Gaussian reaches."""
_PACKAGED = "splats.usdc"
_LONGEST_READING_S = 600.0
"""The program bounds itself by the size of the files, but for what it cannot interrupt."""
_SEARCH_PATH, _THREADS = "PXR_AR_DEFAULT_SEARCH_PATH", "PXR_WORK_THREAD_LIMIT"
"""OpenUSD's: more folders to look in, and how many threads it starts, each of which takes memory."""


def save_usd(path: Path, asset: SplatAsset) -> None:
    """Write ``asset`` as the default prim of a stage with Z up, in metres.

    ``.usdc`` and ``.usd`` are binary, ``.usda`` is text, ``.usdz`` a package of one ``.usdc``. Harmonics of degree 1
    or 2 are written as degree 3, with zeros, for other programs' sake.
    """
    from pxr import Tf, Usd, UsdGeom, UsdVol, Vt

    asset = asset.finite()
    asset = asset.with_degree(next(degree for degree in _DEGREES if degree >= asset.degree))
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, UsdGeom.LinearUnits.meters)
    field = UsdVol.ParticleField3DGaussianSplat.Define(stage, "/Splats")
    stage.SetDefaultPrim(field.GetPrim())
    quaternions = unit_quaternions(asset.quaternions)
    real_last = np.roll(quaternions, -1, axis=1).astype(np.float32)  # the order of Gf.Quatf in memory
    field.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(asset.means))
    field.CreateOrientationsAttr(Vt.QuatfArray.FromNumpy(np.ascontiguousarray(real_last)))
    field.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(linear_scales(asset)))
    field.CreateOpacitiesAttr(Vt.FloatArray.FromNumpy(asset.opacities))
    field.CreateRadianceSphericalHarmonicsDegreeAttr(asset.degree)
    harmonics = field.CreateRadianceSphericalHarmonicsCoefficientsAttr(Vt.Vec3fArray.FromNumpy(asset.sh.reshape(-1, 3)))
    harmonics.SetMetadata("elementSize", asset.sh.shape[1])
    if len(asset):
        field.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(_extent(asset, quaternions)))
    try:
        with publishing(path) as staging:
            if path.suffix.lower() == ".usdz":
                _write_package(staging, stage)
            else:
                stage.GetRootLayer().Export(str(staging))
    except Tf.ErrorException as error:
        raise AssetError("the file cannot be written", where=path, cure="Check the folder and the disk.") from error


def load_usd(path: Path) -> SplatAsset:
    """Read all Gaussian splats of a USD stage, where its transforms put them.

    The stage's up axis and unit count; without them USD means Y up and centimetres. Of
    animated splats the first sample is taken, of degree 4 the degrees up to 3. Raises
    AssetError when the file is damaged or holds no Gaussian splats.
    """
    content(path, 1)
    with ScratchFolder() as folder:
        arrays_file = Path(folder, "stage.npz")
        command = [sys.executable, "-P", usd_stage.__file__, str(path.absolute()), str(arrays_file)]
        alone = {name: value for name, value in os.environ.items() if name != _SEARCH_PATH}
        try:
            subprocess.run(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                check=True,
                timeout=_LONGEST_READING_S,
                cwd=folder,  # where names that are not beside the stage are looked for
                env=alone | {_THREADS: "1"},
            )
        except subprocess.SubprocessError as error:
            raise AssetError("the file is not a readable USD", where=path, cure="Copy or export it again.") from error
        with opened_arrays(arrays_file, AssetError, "the stage's arrays are damaged", "Try again.") as arrays:
            if "refusal" in arrays:
                raise AssetError(
                    str(arrays["refusal"]), where=path, cure="Export the splats as one file, such as .usdc or .usdz."
                )
            if not arrays["count"]:
                raise AssetError(
                    f"there is no {usd_stage.PRIM_TYPE} in the stage", where=path, cure="Export the splats as such."
                )
            world_from_stage = WORLD_FROM_Y_UP.copy() if arrays["y_up"] else np.eye(4)
            world_from_stage[:3] *= arrays["metres_per_unit"]
            assets = []
            for k in range(int(arrays["count"])):
                asset = SplatAsset(
                    means=arrays[f"{k}.positions"],
                    log_scales=log_scales(arrays[f"{k}.scales"]),
                    quaternions=unit_quaternions(np.roll(arrays[f"{k}.orientations_xyzw"], 1, axis=1)),
                    logit_opacities=logits(arrays[f"{k}.opacities"]),
                    sh=arrays[f"{k}.sh"],
                )
                assets.append(in_world(asset, world_from_stage @ arrays[f"{k}.stage_from_prim"], path))
    return assets[0].concatenated(*assets[1:])


def _write_package(path: Path, stage: Usd.Stage) -> None:
    from pxr import Sdf

    with ScratchFolder() as folder:
        layer = str(Path(folder, _PACKAGED))
        stage.GetRootLayer().Export(layer)
        with Sdf.ZipFileWriter.CreateNew(str(path)) as package:
            package.AddFile(layer, _PACKAGED)


def _extent(asset: SplatAsset, quaternions: np.ndarray) -> np.ndarray:
    """(2, 3) float32, the lowest and the highest corner of a box around all Gaussians."""
    axes = to_rotation(quaternions) * linear_scales(asset)[:, None, :]
    reach = _EXTENT_SIGMAS * np.linalg.norm(axes, axis=2)
    return np.stack([(asset.means - reach).min(axis=0), (asset.means + reach).max(axis=0)]).astype(np.float32)


FORMAT = SplatFormat(
    suffixes=(".usd", ".usda", ".usdc", ".usdz"),
    menu=(
        (".usdc", "USD", "All attributes, ParticleField3DGaussianSplat"),
        (".usda", "USD as Text", "All attributes, ParticleField3DGaussianSplat as text"),
        (".usdz", "USD Package", "All attributes, ParticleField3DGaussianSplat in one file to hand on"),
    ),
    rank=4,
    magic=(b"PXR-USDC", b"#usda"),
    load=load_usd,
    save=save_usd,
)
