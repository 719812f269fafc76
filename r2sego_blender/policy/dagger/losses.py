"""Losses that several stages of learning share, and their means over a pass."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch.nn import functional

from ..student.network import LEVELS, PLACE_M

SMALL = 0.1
"""Errors beyond it, shares of a command's limit or of ``PLACE_M``, count by their size, not its square."""


def two_hot(commands: torch.Tensor) -> torch.Tensor:
    """(N, 3, LEVELS) of ``commands`` (N, 3) in [-1, 1]: the two levels beside each share it, and have its mean."""
    place = (commands.clamp(-1.0, 1.0) + 1.0) * ((LEVELS - 1) / 2.0)
    return (1.0 - (place[..., None] - torch.arange(LEVELS)).abs()).clamp_min(0.0)


def seat_loss(said: torch.Tensor, seat: torch.Tensor, where: torch.Tensor) -> torch.Tensor:
    """Of what a head says (N, SEAT_TARGETS) of ``seat``, which is nan for none: its pose ``where`` (N,) bool has it,
    and whether it is in view."""
    known = ~seat[:, 0].isnan()
    if not known.any():
        return said.new_zeros(())
    loss = 0.2 * functional.binary_cross_entropy_with_logits(said[known, 5], seat[known, 5])
    where = known & where
    if where.any():
        loss = loss + functional.smooth_l1_loss(said[where, 0], seat[where, 0] / PLACE_M)
        loss = loss + functional.mse_loss(said[where, 1:5], seat[where, 1:5])
    return loss


class Means:
    """Means of named figures over the updates of a pass."""

    def __init__(self) -> None:
        self._sums: dict[str, float] = {}
        self._count = 0

    def add(self, figures: Mapping[str, float]) -> None:
        """Those of one more update."""
        self._count += 1
        for name, value in figures.items():
            self._sums[name] = self._sums.get(name, 0.0) + value

    def items(self) -> dict[str, float]:
        """The means."""
        return {name: total / self._count for name, total in self._sums.items()}

    def __str__(self) -> str:
        return ", ".join(f"{name} {mean:.4f}" for name, mean in self.items().items())
