"""The slot of the video generator G_theta."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..conditions.conditions import Condition


@dataclass(frozen=True)
class Frame:
    """One generated frame.

    ``image`` (H, W, 3) float32 in [0, 1]; ``confidence`` (H, W) float32 in [0, 1], how far
    each pixel may be trusted; ``generators`` says what stands for one that tells none.
    """

    image: np.ndarray
    confidence: np.ndarray


class Generator(Protocol):
    """Makes a clip from a reference capture along structural conditions (Eq. 3).

    ``name`` is what the bundle, the panels and the report call the backend.
    """

    name: str

    def generate(self, reference: int, conditions: Sequence[Condition]) -> list[Frame]:
        """One frame a condition, at the condition's size; the last one is at the target.

        ``reference`` is the index i(v) of the capture whose view the clip starts from; the
        conditions' cameras are in the world frame, so a generator that wants motions
        relative to the reference takes them from ``paths.reference_from_frame``.
        """
        ...
