"""The arms that are compared: their names, labels and assets in the bundle."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from ..bundle.figures import BASELINES
from ..bundle.layout import INITIAL_ASSET, REFINED_ASSET
from ..config.declared_files import did_you_mean
from ..config.presets import SPARSE_STABLE_SH3, UNBOUNDED, VANILLA_3DGS
from ..config.training_settings import TrainingSettings
from ..core.errors import SettingsError

INITIAL, VANILLA, GAUSSGYM, SAME_POINTS, DIFIX3D_PLUS, GENFUSION, WITHOUT_GENERATED, REFINED = (
    "initial",
    *BASELINES,
    "without_generated_views",
    "refined",
)


@dataclass(frozen=True)
class ArmSource:
    """One arm: what a person reads, its asset in the bundle, and how it was made.

    A method of others that runs in an environment of its own (``external_arms``) has no asset, but ``views``, a file of
    its pictures of the frozen views; ``base`` is the arm whose pictures it begins with, "" where none.
    """

    label: str
    asset: str
    note: str
    views: str = ""
    base: str = ""


ARMS: Mapping[str, ArmSource] = {
    INITIAL: ArmSource("initial asset", INITIAL_ASSET, "reliable stereo of the captures, untrained"),
    VANILLA: ArmSource(
        "vanilla 3DGS",
        "report/vanilla_3dgs.ply",
        "the same observed points, captures and number of steps, as many Gaussians as it makes",
    ),
    GAUSSGYM: ArmSource(
        "GaussGym condition",
        "report/gaussgym.ply",
        "the same at the original's rates with harmonics of degree 3, none added: sparse-stable SH3",
    ),
    SAME_POINTS: ArmSource(
        "same points", "report/same_points.ply", "the same again at this project's rates, without densification"
    ),
    DIFIX3D_PLUS: ArmSource(
        "Difix3D+",
        "",
        "the GaussGym condition's pictures, each fixed by a one-step diffusion model with the nearest capture",
        views="report/difix3d_plus.npz",
        base=GAUSSGYM,
    ),
    GENFUSION: ArmSource(
        "GenFusion",
        "",
        "its own training from the same observed points, captures and number of steps",
        views="report/genfusion.npz",
    ),
    WITHOUT_GENERATED: ArmSource(
        "no generated views",
        "report/without_generated_views/asset.ply",
        "Algorithm 1 without lines 7 to 12: completed geometry and backdrop, captures alone",
    ),
    REFINED: ArmSource("refined", REFINED_ASSET, "Algorithm 1"),
}
"""The arms in the order of the table; the key is the name in metrics.json."""

DEFAULT_ARMS = tuple(name for name, source in ARMS.items() if source.asset)
"""Those that need no environment of their own: what is compared where nobody says otherwise."""


def baseline_settings(training: TrainingSettings) -> Mapping[str, TrainingSettings]:
    """What each baseline that is trained here is trained with, where the scene has ``training``.

    Vanilla's rates, densification and resolution are the original 3DGS', the GaussGym condition's the same but that
    none is added; the same points have this project's, which never densify. The budget of Gaussians is this
    project's own, and bounds none of them.
    """
    return {
        VANILLA: replace(training, **VANILLA_3DGS),
        GAUSSGYM: replace(training, **SPARSE_STABLE_SH3),
        SAME_POINTS: replace(training, **UNBOUNDED),
    }


def strongest_baseline(psnr: Mapping[str, float | None], among: Iterable[str] = BASELINES) -> str:
    """The method of others ``among`` which ``psnr`` by arm is highest, '' where none of them was scored."""

    def height(arm: str) -> float:
        found = psnr[arm]
        return math.inf if found is None else found  # None is that of two equal images

    return max((arm for arm in among if arm in psnr), key=height, default="")


def named_arms(names: Iterable[str]) -> tuple[str, ...]:
    """The arms of these names. Raises SettingsError for one that is none."""
    chosen = tuple(names)
    for name in chosen:
        if name not in ARMS:
            cure = did_you_mean(name, ARMS, f"Known: {', '.join(ARMS)}.")
            raise SettingsError(f"there is no arm '{name}'", where="arms", cure=cure)
    return chosen
