"""What a round's update made of each generated view that it learnt: how much was new, and how near it came.

It is told of every round, for it costs two renderings a view. What that is worth is seen only on
held-out views (``evaluation/view_influence.py``): an asset can come near to a wrong picture.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..bundle.figures import COUNTS, damaged
from ..bundle.scene import Scene
from ..core.json_files import finite_number
from ..generation.ego_views import PseudoObservation
from ..splats.asset import SplatAsset
from ..splats.metrics import psnr
from ..splats.rendering.rasterizer import render
from .visual_asset import MISSING_ALPHA


@dataclass(frozen=True)
class ViewEffect:
    """Of the view of ``rank``: ``new`` in [0, 1], the share of its pixels where the asset before the round showed
    nothing, and PSNR in dB of the assets before and after it to the view's frame, None where they are equal."""

    rank: int
    new: float
    psnr_before: float | None
    psnr_after: float | None

    def to_json(self) -> dict[str, Any]:
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, entry: Mapping[str, Any]) -> ViewEffect:
        """Raises LookupError, TypeError or ValueError for what ``to_json`` does not write."""
        before, after = (
            None if entry[name] is None else finite_number(entry[name]) for name in ("psnr_before", "psnr_after")
        )
        return cls(int(finite_number(entry["rank"])), finite_number(entry["new"]), before, after)


def view_effect(view: PseudoObservation, before: SplatAsset, after: SplatAsset, backdrop: SplatAsset) -> ViewEffect:
    """Of one view, with ``backdrop`` behind the assets ``before`` and ``after`` the round."""
    behind = render(backdrop, view.camera).colour
    then, now = render(before, view.camera, behind), render(after, view.camera, behind)
    new = round(float((then.alpha < MISSING_ALPHA).mean()), 4)
    return ViewEffect(view.rank, new, *(_finite(psnr(shown.colour, view.image)) for shown in (then, now)))


def effects_of_round(scene: Scene, index: int) -> dict[int, ViewEffect]:
    """What a round's update made of its views, by rank; nothing of one that was cut off before its counts.

    Raises SceneError where they are damaged.
    """
    counts = COUNTS.of_round(index)
    if not (scene.path / counts.name).is_file():
        return {}
    try:
        return effects_by_rank(scene.read(counts).get("views", ()))
    except (LookupError, TypeError, ValueError) as error:
        raise damaged(scene.path / counts.name, "what its views did is missing or wrong") from error


def effects_by_rank(entries: Sequence[Mapping[str, Any]]) -> dict[int, ViewEffect]:
    """Of a round's counts; raises as ``ViewEffect.from_json`` does."""
    return {effect.rank: effect for effect in map(ViewEffect.from_json, entries)}


def _finite(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None
