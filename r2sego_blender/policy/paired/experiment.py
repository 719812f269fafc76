"""Policies trained in two visual assets of one room, pair by pair, all else the same, and tested in several ways."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from ...core.errors import SettingsError
from ...core.json_files import opened_json
from ...core.progress import SILENT, Progress
from ...workers.child import call_in_child
from ..dagger.episodes import Outcome
from ..dagger.settings import DaggerSettings
from ..same_run import begin_or_go_on
from ..training import Task
from .policies import OUTCOMES, as_json, train_and_test

DECLARED = "experiment.json"
_LONGEST_S = 48.0 * 3600.0

Outcomes = Mapping[str, tuple[Outcome, ...]]
"""Of each test."""


@dataclass(frozen=True)
class PairedExperiment:
    """A policy is trained for each of ``seeds`` in each of two ``arms``, and tested on ``episodes`` a test.

    ``arms`` are Tasks by name, the one expected to be worse first; they differ in their asset alone. The two
    policies of a seed share initial weights, the teacher's episodes, seeds and order. ``tests`` are, by name, what
    of the Task is another there. The seed of ``settings`` is the first pair's; the next have the next.
    """

    arms: Mapping[str, Task]
    tests: Mapping[str, Mapping[str, Any]]
    seeds: int = 5
    episodes: int = 25
    settings: DaggerSettings = DaggerSettings()

    def declared(self) -> dict[str, Any]:
        """All that decides the outcomes, ready for JSON; files by their content. Raises as ``Task.declared``."""
        return {
            "tasks": {arm: {name: task.declared() for name, task in self.tasks(arm).items()} for arm in self.arms},
            "seeds": self.seeds,
            "episodes": self.episodes,
            "settings": dataclasses.asdict(self.settings),
        }

    def tasks(self, arm: str) -> dict[str, Task]:
        """What an arm's policies are tested in, by name: first what they learn in, then the ``tests``."""
        task = self.arms[arm]
        return {"training": task} | {name: dataclasses.replace(task, **more) for name, more in self.tests.items()}


def run_experiment(
    experiment: PairedExperiment,
    folder: Path,
    processes: int = 2,
    progress: Progress = SILENT,
    train: Callable[[dict[str, Any]], object] = partial(call_in_child, train_and_test, timeout_s=_LONGEST_S),
) -> dict[str, list[Outcomes]]:
    """Outcomes of each arm's policies, seed by seed; those that ``folder`` has are not made again.

    Each policy has a process of its own and one thread; the two of a pair run side by side. ``train`` does what
    ``policies.train_and_test`` does, elsewhere. Raises SettingsError
    where ``folder`` has another experiment, or an older version's, and what training and its environments raise.
    """
    declared = experiment.declared()
    folder.mkdir(parents=True, exist_ok=True)
    begin_or_go_on(folder / DECLARED, declared, "experiment")
    cells = [(seed, arm) for seed in range(experiment.seeds) for arm in experiment.arms]
    with ThreadPoolExecutor(processes) as pool, progress.task("Policies", len(cells)) as task:
        running = {pool.submit(_policy, experiment, folder, *cell, train): cell for cell in cells}
        try:
            for done in as_completed(running):
                done.result()
                task.advance(1)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return {arm: [found(folder, seed, arm) for seed in range(experiment.seeds)] for arm in experiment.arms}


def found(folder: Path, seed: int, arm: str) -> Outcomes:
    """The outcomes of one policy's tests. Raises SettingsError where its file is damaged."""
    file = _place(folder, seed, arm) / OUTCOMES
    with opened_json(file, SettingsError, "a policy's outcomes are damaged", "Remove the file.") as tests:
        return {name: tuple(Outcome(*outcome) for outcome in outcomes) for name, outcomes in tests.items()}


def _place(folder: Path, seed: int, arm: str) -> Path:
    return folder / f"seed_{seed}" / arm


def _policy(
    experiment: PairedExperiment, folder: Path, seed: int, arm: str, train: Callable[[dict[str, Any]], object]
) -> None:
    place = _place(folder, seed, arm)
    if (place / OUTCOMES).exists():
        return
    settings = experiment.settings
    request = {
        "place": str(place.resolve()),
        "task": as_json(experiment.arms[arm]),
        "tests": {name: as_json(test) for name, test in experiment.tasks(arm).items()},
        "settings": dataclasses.asdict(dataclasses.replace(settings, seed=settings.seed + seed)),
        "episodes": experiment.episodes,
    }
    train(request)
