"""What a round's update made of the generated views that it learnt, as its counts tell it.

Needs the standard library alone, so Blender's Python reads it. ``refine.view_effect`` measures it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..bundle.figures import COUNTS, damaged
from ..bundle.scene import Scene
from ..core.json_files import finite_number

_NEARNESS = ("psnr_before", "psnr_after")


@dataclass(frozen=True)
class ViewEffect:
    """Of the view of ``rank``: ``new`` in [0, 1], the share of its pixels where the asset before the round showed
    nothing, and PSNR in dB of the assets before and after it to the view's frame, None where they are equal."""

    rank: int
    new: float
    psnr_before: float | None
    psnr_after: float | None

    def __str__(self) -> str:
        before, after = ("equal" if one is None else f"{one:.1f}" for one in (self.psnr_before, self.psnr_after))
        return f"{self.new:.0%} new to the asset, which came from {before} to {after} dB"

    def to_json(self) -> dict[str, Any]:
        """As a round's counts have it."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, entry: Mapping[str, Any]) -> ViewEffect:
        """Raises LookupError, TypeError or ValueError for what ``to_json`` does not write."""
        before, after = (None if entry[name] is None else finite_number(entry[name]) for name in _NEARNESS)
        return cls(int(finite_number(entry["rank"])), finite_number(entry["new"]), before, after)


def effects_of_round(scene: Scene, index: int) -> dict[int, ViewEffect]:
    """Of round ``index``, by rank; of no view where it was cut off before its counts.

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
    """Of the entries of a round's counts; raises as ``ViewEffect.from_json`` does."""
    return {effect.rank: effect for effect in map(ViewEffect.from_json, entries)}
