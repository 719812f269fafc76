"""The causes of the error as the report shows them: shares, and the worst views coloured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..core.json_files import finite_number
from .arms import REFINED
from .frozen import ArmScore
from .report_data import CausesOfView, ErrorCause, ErrorSplit, FrozenView
from .scene_causes import CAUSES, SceneCauses, ViewCauses

CAUSE_COLOURS: Mapping[str, tuple[float, float, float]] = {
    "wrong_depth": (0.84, 0.37, 0.00),
    "off_surface": (0.80, 0.40, 0.66),
    "never_seen": (0.16, 0.47, 0.74),
    "edges": (0.92, 0.80, 0.20),
    "appearance": (0.10, 0.62, 0.47),
}
"""Of each of ``CAUSES``, sRGB in [0, 1]; told apart with any eyes (after Okabe and Ito)."""

_LARGE_ERROR = 0.25
"""A root mean squared colour error from which on a pixel has its cause's full colour."""

_WORST_VIEWS = 4

_NAMED_FROM = 0.1
"""A cause with less than this share of a view's error is not named under its picture."""

_FAINTEST, _STRONGEST = 0.30, 0.95
_DIM = 0.75


def cause_picture(labels: np.ndarray, image: np.ndarray, photograph: np.ndarray) -> np.ndarray:
    """The photograph in grey under the causes' colours, stronger where the error is larger.

    ``labels`` (H, W) are indices into ``CAUSES``; ``image`` and ``photograph`` (H, W, 3) in
    [0, 1]. Returns (H, W, 3) float32.
    """
    palette = np.array([CAUSE_COLOURS[name] for name in CAUSES], np.float32)
    error = np.sqrt(np.mean((image - photograph) ** 2, axis=-1, dtype=np.float64)) / _LARGE_ERROR
    strength = _FAINTEST + (_STRONGEST - _FAINTEST) * np.clip(error, 0.0, 1.0)[..., None]
    grey = _DIM * photograph.mean(axis=-1, keepdims=True)
    return (strength * palette[labels] + (1.0 - strength) * grey).astype(np.float32)


def report_causes(causes: SceneCauses | str, refined: ArmScore, frozen: Sequence[FrozenView]) -> ErrorSplit:
    """What the report shows of the causes; text says why there are none.

    ``frozen`` hold the photographs and the refined asset's renderings in memory. The views
    on which ``refined`` has the lowest PSNR are coloured.
    """
    if isinstance(causes, str):
        return ErrorSplit(unavailable=causes)
    rows = []
    for name, cause in CAUSES.items():
        share = causes.shares[name]
        figures = () if share is None else (share.error, share.pixels, share.psnr)
        rows.append(ErrorCause(cause.label, cause.meaning, cause.mended_by, CAUSE_COLOURS[name], *figures))
    shown, found = {view.name: view for view in frozen}, {view.name: view for view in causes.views}
    worst = []
    for scored in sorted(refined.views, key=lambda view: view.psnr)[:_WORST_VIEWS]:
        view = shown[scored.name]
        image = next(r.picture for r in view.renderings if r.arm == REFINED)
        assert isinstance(image, np.ndarray) and isinstance(view.truth, np.ndarray)
        coloured = cause_picture(found[view.name].labels, image, view.truth)
        worst.append(CausesOfView(view.name, view.truth, image, coloured, scored.psnr, _summary(found[view.name])))
    return ErrorSplit(causes.told_by, tuple(rows), tuple(worst), causes.note)


def split_in(entry: Any) -> ErrorSplit | None:
    """What ``metrics.json`` says of the causes, as the report shows it; None where it says none."""
    try:
        found = {str(one["cause"]): one for one in entry["shares"]}
        rows = [
            ErrorCause(
                cause.label,
                cause.meaning,
                cause.mended_by,
                CAUSE_COLOURS[name],
                *(None if found[name][key] is None else finite_number(found[name][key]) for key in _FIGURES),
            )
            for name, cause in CAUSES.items()
        ]
        return ErrorSplit(str(entry["told_by"]), tuple(rows), note=str(entry.get("note", "")))
    except (LookupError, TypeError, ValueError, AttributeError):
        return None


_FIGURES = ("error", "pixels", "psnr")


def _summary(view: ViewCauses) -> str:
    """The largest causes of a view's error, such as "wrong depth 48 %, edges 21 %"."""
    largest = sorted(view.shares.items(), key=lambda one: -one[1].error)
    named = [(name, share) for name, share in largest if share.error >= _NAMED_FROM]
    return ", ".join(f"{CAUSES[name].label} {share.error:.0%}".replace("%", " %") for name, share in named)
