"""The Gaussians in training with all that is remembered of them: added, moved and removed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kernels.adam import AdamState
from ..kernels.packing import MEAN, PackedGaussians, morton_order
from ..vector_language.vectors import LANES


@dataclass
class Population:
    """Packed Gaussians and Adam's state; a *place* is a Gaussian's index in the chunks.

    Rows of parameters are (n, C) float32 in the order of the packed rows, see ``packing``.
    """

    gaussians: PackedGaussians
    state: AdamState

    @staticmethod
    def of(gaussians: PackedGaussians) -> Population:
        return Population(gaussians, AdamState.of(gaussians))

    def __len__(self) -> int:
        return len(self.gaussians)

    @property
    def room(self) -> int:
        """How many more Gaussians fit."""
        return len(self.gaussians.chunks) * LANES - len(self)

    def column(self, row: int) -> np.ndarray:
        """One parameter of all Gaussians (N,), a copy."""
        return self.gaussians.values[:, row].reshape(-1)[: len(self)]

    def columns(self, first: int, stop: int) -> np.ndarray:
        """Parameters ``first`` to before ``stop`` of all Gaussians (N, stop - first), a copy."""
        return np.stack([self.column(row) for row in range(first, stop)], axis=1)

    def rows(self, places: np.ndarray) -> np.ndarray:
        """All parameters of some Gaussians (n, C)."""
        return self.gaussians.chunks[places // LANES, :, places % LANES]

    def replace(self, places: np.ndarray, rows: np.ndarray) -> None:
        """Put new Gaussians into ``places``; nothing is remembered of the old ones."""
        self.gaussians.chunks[places // LANES, :, places % LANES] = rows
        self.forget(places)

    def append(self, rows: np.ndarray) -> np.ndarray:
        """Add Gaussians; returns their places. There must be ``room``."""
        places = np.arange(len(self), len(self) + len(rows))
        numbers = np.arange(len(rows)) + (self.gaussians.order.max(initial=-1) + 1)
        self.gaussians.order = np.concatenate([self.gaussians.order, numbers])
        self.replace(places, rows)
        self.gaussians.hide_rest()
        return places

    def set_column(self, places: np.ndarray, row: int, values: np.ndarray) -> None:
        """Change one parameter of some Gaussians and forget its moments."""
        for chunks, new in ((self.gaussians.chunks, values), (self.state.first, 0.0), (self.state.second, 0.0)):
            chunks[places // LANES, row, places % LANES] = new

    def forget(self, places: np.ndarray) -> None:
        """Start Adam and the statistics of some Gaussians anew."""
        chunk, lane = places // LANES, places % LANES
        for chunks in (self.state.first, self.state.second, self.state.statistics):
            chunks[chunk, :, lane] = 0.0
        self.state.steps[chunk, lane] = 0.0

    def statistics(self) -> np.ndarray:
        """(N,) the mean shift of each Gaussian's centre since the last call, in half images."""
        count = len(self)
        shift, images = (self.state.statistics[:, k].reshape(-1)[:count] for k in range(2))
        mean = shift / np.maximum(images, 1.0)
        self.state.statistics[:] = 0.0
        return mean

    def arrange(self, places: np.ndarray) -> None:
        """Keep the Gaussians of ``places``, in that order; the others are gone."""
        count, old = len(places), -(-len(self) // LANES)
        for chunks in (
            self.gaussians.chunks,
            self.state.first,
            self.state.second,
            self.state.statistics,
            self.state.steps[:, None],
        ):
            rows = chunks[places // LANES, :, places % LANES]
            chunks[:old] = 0.0
            index = np.arange(count)
            chunks[index // LANES, :, index % LANES] = rows
        numbers = self.gaussians.order[places]
        # The asset's numbers stay dense when Gaussians are gone.
        self.gaussians.order = np.argsort(np.argsort(numbers, kind="stable"), kind="stable")
        self.gaussians.hide_rest()

    def sort(self) -> None:
        """Bring neighbours in space together again."""
        self.arrange(morton_order(self.columns(MEAN, MEAN + 3)))
