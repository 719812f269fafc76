"""The figures of ``report/metrics.json`` as the panels show them. No bpy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ...bundle.figures import BASELINES
from ...bundle.layout import REFINED_ASSET
from ...core.errors import SceneError
from ...core.json_files import finite_number
from .bundle import Bundle

ARM_LABELS = {
    "refined": "Refined",
    "without_generated_views": "No generated views",
    "genfusion": "GenFusion",
    "difix3d_plus": "Difix3D+",
    "same_points": "Same points",
    "gaussgym": "GaussGym",
    "vanilla_3dgs": "Vanilla 3DGS",
    "initial": "Initial",
}
_ORDER = list(ARM_LABELS)


@dataclass(frozen=True)
class Score:
    """One line: an arm's or a round's scores; None where a score is not known."""

    label: str
    psnr: float | None
    ssim: float | None
    lpips: float | None = None
    note: str = ""


@dataclass(frozen=True)
class Cause:
    """A cause of the refined asset's error, with its shares of the error and of the pixels."""

    label: str
    error: float | None
    pixels: float | None
    mended_by: str = ""


@dataclass(frozen=True)
class ReportScores:
    """What an evaluation came to; ``causes_note`` says by what causes were told, or why not.

    ``outdated``: the refined asset has changed since.
    """

    arms: tuple[Score, ...] = ()
    rounds: tuple[Score, ...] = ()
    causes: tuple[Cause, ...] = ()
    causes_note: str = ""
    outdated: bool = False

    @property
    def has_lpips(self) -> bool:
        """Whether LPIPS is known of an arm."""
        return any(arm.lpips is not None for arm in self.arms)

    @property
    def mending(self) -> str:
        """What mends the largest cause of the error, '' where none is known."""
        largest = max(self.causes, key=lambda cause: cause.error or 0.0, default=None)
        if largest is None or not largest.error or not largest.mended_by:
            return ""
        return f"{largest.label}: {largest.mended_by}"

    @property
    def summary(self) -> str:
        """The refined asset's scores and its gain over the strongest baseline, '' where they are not known."""
        if self.outdated:
            return ""
        arms = {arm.label: arm for arm in self.arms}
        refined = arms.get(ARM_LABELS["refined"])
        others = [arms[ARM_LABELS[name]].psnr for name in BASELINES if ARM_LABELS[name] in arms]
        if refined is None or refined.psnr is None or refined.ssim is None:
            return ""
        known = [psnr for psnr in others if psnr is not None]
        gain = f" ({refined.psnr - max(known):+.2f})" if known else ""
        return f"{refined.psnr:.2f} dB{gain}, SSIM {refined.ssim:.3f}"


def report_scores(bundle: Bundle) -> ReportScores:
    """The figures of a bundle, empty before an evaluation. Raises SceneError when they are damaged."""
    metrics = bundle.metrics()
    try:
        arms = sorted(metrics.get("arms", {}).items(), key=lambda item: (_place(item[0]), item[0]))
        causes = metrics.get("causes") or {}
        return ReportScores(
            tuple(_score(ARM_LABELS.get(name, name), arm) for name, arm in arms),
            tuple(_score(f"Round {one['round']}", one) for one in metrics.get("rounds", ())),
            tuple(_cause(one) for one in causes.get("shares", ())),
            str(causes.get("unavailable") or causes.get("told_by") or ""),
            outdated=bool(metrics) and REFINED_ASSET in not_scored(bundle, metrics),
        )
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise SceneError(
            f"the field {error} is missing or wrong", where=bundle.scene.metrics_file, cure="Run Evaluate again."
        ) from error


def not_scored(bundle: Bundle, metrics: Mapping[str, Any]) -> frozenset[str]:
    """The results in a bundle, by their names, that are not as they were when ``metrics`` were made."""
    scored, now = metrics.get("assets") or {}, bundle.scene.outputs()
    return frozenset(name for name in {*scored, *now} if scored.get(name) != now.get(name))


def _place(name: str) -> int:
    return _ORDER.index(name) if name in _ORDER else len(_ORDER)


def _score(label: str, told: Mapping[str, Any]) -> Score:
    note = str(told.get("missing") or told.get("mark") or "")
    return Score(label, _number(told["psnr"]), _number(told["ssim"]), _number(told.get("lpips_alex")), note)


def _cause(told: Mapping[str, Any]) -> Cause:
    label = str(told.get("label") or told["cause"]).capitalize()
    return Cause(label, _number(told["error"]), _number(told["pixels"]), str(told.get("mended_by") or ""))


def _number(value: Any) -> float | None:
    return None if value is None else finite_number(value)
