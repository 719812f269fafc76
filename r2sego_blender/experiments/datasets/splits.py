"""Which frames of a data set are captures, and which of the others are held out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from ...core.errors import ExperimentError

T = TypeVar("T")


def equally_spaced(things: Sequence[T], count: int, where: Path, what: str = "photographs") -> list[T]:
    """So many of them, from the first to the last, as sparse-view methods take theirs (RegNeRF, FSGS).

    Raises ExperimentError where there are fewer.
    """
    if len(things) < count:
        raise ExperimentError(
            f"there are {len(things)} {what}, and {count} are asked for", where=where, cure="Ask for fewer."
        )
    return [things[index] for index in np.linspace(0, len(things) - 1, count).round().astype(int)]


def around(captures: Iterable[int], frames: int, reach: int, step: int) -> list[int]:
    """Every ``step``-th of the frames up to ``reach`` before and after each capture, but no capture; sorted.

    The rule of GuidedVD-3DGS (Zhong et al. 2025) for Replica: the frames before a capture and those after it
    are one list, of which every ``step``-th counts.
    """
    captures = list(captures)
    found: set[int] = set()
    for capture in captures:
        near = [*range(max(0, capture - reach), capture), *range(capture + 1, min(capture + reach, frames))]
        found.update(near[::step])
    return sorted(found - set(captures))
