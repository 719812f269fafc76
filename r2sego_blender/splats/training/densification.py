"""Where Gaussians are added while an asset is trained, and where they are taken away.

Three ways under one budget, called every so many steps:

* ``growth``: the number follows a fixed curve up to the budget, and at each time the
  Gaussians are copied or split whose centres the images pull at most, over all views since
  the last time (scored growth; Mallick et al. 2024, Taming 3DGS).
* ``relocation``: dead Gaussians are moved onto living ones, chosen by opacity, so that the
  image hardly changes, and five in a hundred are added (Kheradmand et al. 2024, 3DGS-MCMC).
* ``original``: Gaussians above a gradient threshold are copied or split, faint and huge ones
  removed, opacities reset (Kerbl et al. 2023).
"""

from __future__ import annotations

import math

import numpy as np

from ...config.training_settings import TrainingSettings
from ..kernels.packing import LOG_SCALE, LOGIT_OPACITY, MEAN, QUATERNION
from ..quaternions import to_rotation
from .population import Population

_SPLIT_SHRINKS = 1.6
"""A split Gaussian's halves are smaller by this factor (Kerbl et al.: 0.8 times their number)."""

_GROWTH_RATE = 0.05
"""Share of Gaussians added each time by relocation (Kheradmand et al.)."""

_SORT_GROWTH = 1.2
"""Gaussians are brought into the order of space again when they are this many times more."""

_MOST_COPIES = 51
_RESET_OPACITY = 0.01
_HUGE_SHARE = 0.1  # of the scene's extent, above which 3DGS removes a Gaussian


class Densification:
    """Adds and removes Gaussians of a population by the step; see the module's text."""

    def __init__(
        self, population: Population, steps: int, extent_m: float, settings: TrainingSettings, rng: np.random.Generator
    ) -> None:
        self._population, self._settings, self._rng = population, settings, rng
        self._extent_m, self._start = extent_m, len(population)
        self._sorted = len(population)
        self._first = max(1, round(steps * settings.densify_from_share))
        self._last = round(steps * settings.densify_until_share)

    def is_due(self, step: int) -> bool:
        """Whether ``after`` changes Gaussians after this step, counted from 0."""
        settings, done = self._settings, step + 1
        if settings.densification == "none" or not self._first <= done <= self._last:
            return False
        resets = settings.densification == "original" and done % settings.opacity_reset_steps == 0
        return resets or done % settings.densify_every_steps == 0

    def after(self, step: int) -> None:
        """To be called after every step, at least after those for which it is due."""
        settings, done = self._settings, step + 1
        if not self.is_due(step):
            return
        if done % settings.densify_every_steps == 0:
            {"growth": self._grow, "relocation": self._relocate, "original": self._original}[settings.densification](
                done
            )
            if len(self._population) > _SORT_GROWTH * self._sorted:
                self._population.sort()
                self._sorted = len(self._population)
        if settings.densification == "original" and done % settings.opacity_reset_steps == 0:
            self._reset_opacity()

    def _grow(self, done: int) -> None:
        self._remove_faint()
        population, settings = self._population, self._settings
        passed = done - self._first + settings.densify_every_steps
        share = min(1.0, passed / max(self._last - self._first, 1))
        # A concave curve: most are added early, when the images still disagree most.
        planned = self._start + (settings.max_gaussians - self._start) * math.sqrt(share)
        wanted = min(int(planned) - len(population), population.room, len(population))
        score = population.statistics() * _opacities(population)
        if wanted > 0:
            chosen = np.argpartition(-score, wanted - 1)[:wanted]
            self._add_beside(np.sort(chosen[score[chosen] > 0.0]))

    def _original(self, done: int) -> None:
        population, settings = self._population, self._settings
        gradient = population.statistics()
        wanted = np.flatnonzero(gradient >= settings.gradient_threshold)
        if len(wanted) > self._room:  # the budget is hard: those that are pulled at most
            wanted = np.sort(wanted[np.argsort(-gradient[wanted], kind="stable")[: self._room]])
        self._add_beside(wanted)
        gone = _opacities(population) < settings.dead_opacity
        if done > settings.opacity_reset_steps:
            gone |= _largest_scale(population) > _HUGE_SHARE * self._extent_m
        self._keep(~gone)

    def _relocate(self, done: int) -> None:
        population, settings = self._population, self._settings
        opacity = _opacities(population)
        dead = np.flatnonzero(opacity <= settings.dead_opacity)
        alive = np.flatnonzero(opacity > settings.dead_opacity)
        if not len(alive):
            return
        population.statistics()
        if len(dead):
            population.replace(dead, self._copies(alive, opacity, len(dead)))
        added = min(int(_GROWTH_RATE * len(population)), self._room)
        if added:
            population.append(self._copies(alive, _opacities(population), added))

    @property
    def _room(self) -> int:
        """How many Gaussians may be added."""
        population = self._population
        return max(0, min(population.room, self._settings.max_gaussians - len(population)))

    def _copies(self, alive: np.ndarray, opacity: np.ndarray, count: int) -> np.ndarray:
        """``count`` copies (rows) of living Gaussians, which are changed as well.

        A Gaussian and its copies together look as it did alone (Kheradmand et al., Eq. 9).
        """
        population = self._population
        weight = opacity[alive] / opacity[alive].sum()
        source = self._rng.choice(alive, count, p=weight / weight.sum())
        unique, copies = np.unique(source, return_counts=True)
        rows = population.rows(unique)
        before = opacity[unique].astype(np.float64)
        number = np.minimum(copies + 1, _MOST_COPIES)
        after = 1.0 - (1.0 - before) ** (1.0 / number)
        rows[:, LOGIT_OPACITY] = _logit(np.clip(after, 0.005, 1.0 - 1e-6))
        rows[:, LOG_SCALE:QUATERNION] += np.log(_shrinking(before, after, number))[:, None]
        population.replace(unique, rows)
        return rows[np.searchsorted(unique, source)]

    def _add_beside(self, chosen: np.ndarray) -> None:
        """Copy small Gaussians; split large ones into two, drawn from their own distribution."""
        population = self._population
        rows = population.rows(chosen)
        scales = np.exp(rows[:, LOG_SCALE:QUATERNION])
        split = scales.max(axis=1) > self._settings.split_scale * self._extent_m
        offsets = self._rng.normal(size=(2, len(chosen), 3)) * scales
        rotation = to_rotation(rows[:, QUATERNION:LOGIT_OPACITY])
        moved = np.einsum("nij,knj->kni", rotation, offsets).astype(np.float32)
        first, second = rows.copy(), rows.copy()
        for half, offset in ((first, moved[0]), (second, moved[1])):
            half[split, MEAN:LOG_SCALE] += offset[split]
            half[split, LOG_SCALE:QUATERNION] -= np.float32(math.log(_SPLIT_SHRINKS))
        population.replace(chosen[split], first[split])
        population.append(second)

    def _remove_faint(self) -> None:
        self._keep(_opacities(self._population) >= self._settings.dead_opacity)

    def _keep(self, kept: np.ndarray) -> None:
        if not kept.all() and kept.any():
            self._population.arrange(np.flatnonzero(kept))

    def _reset_opacity(self) -> None:
        """Opacities above 0.01 fall to it: what is needed comes back (Kerbl et al., Sec. 5.2)."""
        population = self._population
        logit = population.column(LOGIT_OPACITY)
        low = np.minimum(logit, _logit(np.float64(_RESET_OPACITY)))
        population.set_column(np.arange(len(population)), LOGIT_OPACITY, low)


def _opacities(population: Population) -> np.ndarray:
    return 1.0 / (1.0 + np.exp(-np.clip(population.column(LOGIT_OPACITY).astype(np.float64), -60.0, 60.0)))


def _largest_scale(population: Population) -> np.ndarray:
    return np.exp(population.columns(LOG_SCALE, QUATERNION)).max(axis=1)


def _logit(opacity: np.ndarray | np.float64) -> np.ndarray:
    return np.log(opacity / (1.0 - opacity))


def _shrinking(before: np.ndarray, after: np.ndarray, number: np.ndarray) -> np.ndarray:
    """The scales' factor for ``number`` Gaussians of opacity ``after`` to look like one of
    ``before``: before / sum_i sum_k (i-1 over k) (-1)^k after^(k+1) / sqrt(k+1)."""
    total = np.zeros_like(before)
    for k in range(int(number.max(initial=1))):
        # The inner binomials summed over i from k + 1 to the number: (number over k + 1).
        ways = np.array([math.comb(int(n), k + 1) for n in number], np.float64)
        total += ways * (-1.0) ** k * after ** (k + 1) / math.sqrt(k + 1)
    return before / np.maximum(total, 1e-12)
