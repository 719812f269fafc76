"""The loop of DAgger: the eye learns first, then the student from the teacher's episodes and from mixed ones."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ...core.progress import SILENT, Progress, Task
from ...robot.controllers.commanded_drive import DriveLimits
from ..packages import policy_package
from ..student.network import Student
from .acting import labelled_episode, labelled_views
from .checkpoints import Place, load_checkpoint, save_checkpoint
from .episodes import EpisodeStore
from .evaluation import Evaluation
from .interfaces import Environment, Teacher
from .learning import SeenEpisode, learn, scale
from .localization import localize
from .losses import Means
from .settings import DaggerSettings

CHECKPOINT = "checkpoint.npz"
_VIEWS_A_FILE = 250
# The eye that learns on takes one of so many views, others each time, at this share of the first learning rate.
_VIEWS_APART, _LATER_RATE = 4, 0.5


def train_student(
    environment: Environment,
    teacher: Teacher,
    settings: DaggerSettings,
    folder: Path,
    limits: DriveLimits | None = None,
    progress: Progress = SILENT,
) -> Student:
    """Train a student in ``folder``, or go on from where a training with the same settings ended there.

    A training that was cut off and goes on makes the same bits as an undisturbed one. Two whose environments
    differ in what they show alone share initial weights, the teacher's episodes, seeds and order. Raises
    SettingsError where ``folder`` holds a training with other settings, MachineError where it is damaged or a
    package of the extra ``policy`` is missing.
    """
    writer = policy_package("tensorboardX")
    with _threads(settings.threads), contextlib.ExitStack() as stack:
        run = _Run.begin(environment, teacher, settings, limits or DriveLimits(), folder)
        log = writer.SummaryWriter(str(folder / "logs"), purge_step=run.place.updates)
        stack.callback(log.close)
        run.collect_views(progress)
        for iteration in range(run.place.iteration, settings.iterations + 1):
            run.collect(iteration, progress, log)
            run.learn_to_see(iteration, progress, log)
            run.learn(iteration, progress, log)
    return run.student.eval()


def view_seed(settings: DaggerSettings, number: int) -> int:
    """The seed of a training's view ``number``."""
    return int(np.random.SeedSequence([settings.seed, number, 2]).generate_state(1)[0])


def episode_seed(settings: DaggerSettings, number: int) -> int:
    """The seed of a training's episode ``number``: trainings of other seeds have others."""
    return int(np.random.SeedSequence([settings.seed, number]).generate_state(1)[0])


@contextlib.contextmanager
def _threads(count: int) -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


@dataclass
class _Run:
    environment: Environment
    teacher: Teacher
    settings: DaggerSettings
    limits: DriveLimits
    folder: Path
    store: EpisodeStore
    views: EpisodeStore
    student: Student
    optimizer: torch.optim.Adam
    place: Place
    seen: list[SeenEpisode] = field(default_factory=list)

    @staticmethod
    def begin(
        environment: Environment, teacher: Teacher, settings: DaggerSettings, limits: DriveLimits, folder: Path
    ) -> _Run:
        """A new one, or the one that ``folder`` holds."""
        folder.mkdir(parents=True, exist_ok=True)
        observation, _ = environment.reset(episode_seed(settings, 0))
        with torch.random.fork_rng(devices=()):
            torch.manual_seed(settings.seed)
            student = Student(len(observation["proprio"]))
        optimizer = torch.optim.Adam(student.parameters(), settings.learning_rate)
        file = folder / CHECKPOINT
        if file.exists():
            place = load_checkpoint(file, student, optimizer, settings)
        else:
            place = Place()
            save_checkpoint(file, student, optimizer, place, settings)
        store, views = EpisodeStore(folder / "episodes"), EpisodeStore(folder / "views")
        return _Run(environment, teacher, settings, limits, folder, store, views, student, optimizer, place)

    def count(self, iteration: int) -> int:
        """Episodes when those of ``iteration`` are there."""
        return self.settings.teacher_episodes + iteration * self.settings.episodes

    def collect_views(self, progress: Progress) -> None:
        """Record the views that are not there yet."""
        for number, seeds in enumerate(progress.track(self._view_seeds(), "Views")):
            if number not in self.views:
                self.views.add(number, labelled_views(self.environment, self.teacher, seeds, self.limits))

    def _view_seeds(self) -> list[list[int]]:
        seeds = [view_seed(self.settings, number) for number in range(self.settings.views)]
        return [seeds[begin : begin + _VIEWS_A_FILE] for begin in range(0, len(seeds), _VIEWS_A_FILE)]

    def collect(self, iteration: int, progress: Progress, log: Any) -> None:
        """Record the episodes of ``iteration`` that are not there yet."""
        settings, beta = self.settings, self.settings.beta(iteration)
        numbers = range(0 if iteration == 0 else self.count(iteration - 1), self.count(iteration))
        student = None if iteration == 0 else self.student
        for number in progress.track(numbers, f"Episodes {iteration}/{settings.iterations}"):
            if number not in self.store:
                seed = episode_seed(settings, number)
                made = labelled_episode(self.environment, self.teacher, student, beta, seed, settings, self.limits)
                self.store.add(number, made)
        evaluation = Evaluation.of(self.store[number].outcome for number in numbers)
        progress.message(f"iteration {iteration}, teacher's share {beta:.2f}: {evaluation}")
        log.add_scalar("episodes/success", evaluation.rate, self.place.updates)
        log.add_scalar("episodes/teacher_share", beta, self.place.updates)
        log.add_scalar("episodes/mean_assist_n", evaluation.mean_assist_n, self.place.updates)

    def learn_to_see(self, iteration: int, progress: Progress, log: Any) -> None:
        """Let the eye learn where it is: first from the views and the teacher's episodes, and after each later
        iteration from all episodes, where the student stands as it will, and from some of the views."""
        wanted = self.settings.eye_passes(iteration)
        if self.place != Place() and self.place.eye_epochs >= wanted:
            return  # what it learns from is not opened again
        numbers = range(math.ceil(self.settings.views / _VIEWS_A_FILE))
        if iteration > 0:
            numbers = numbers[iteration % _VIEWS_APART :: _VIEWS_APART]
            self.seen.clear()  # it sees them otherwise now
        views = [self.views[number] for number in numbers]
        acted = [self.store[number] for number in range(self.count(iteration))]
        if self.place == Place():
            scale(self.student, acted, views)
        first = self.settings.eye_passes(iteration - 1) if iteration > 0 else 0
        everything = [*views, *acted]
        left = wanted - self.place.eye_epochs
        with progress.task(f"Seeing {iteration}/{self.settings.iterations}", left * sum(map(len, everything))) as task:
            for epoch in range(self.place.eye_epochs, wanted):
                rates = self._eye_rates(epoch, first, wanted)
                steps = localize(self.student, self.optimizer, everything, self.settings, epoch, rates)
                means = self._pass(steps, task, log)
                self._keep(replace(self.place, eye_epochs=epoch + 1))
                progress.message(f"pass {epoch + 1}/{wanted} of the eye: {means}")

    def _eye_rates(self, epoch: int, first: int, wanted: int) -> tuple[float, float]:
        """Shares of the learning rate at the beginning and the end of a pass: they fall to 0, from less later."""
        highest = 1.0 if first == 0 else _LATER_RATE
        share = [1.0 - (number - first) / (wanted - first) for number in (epoch, epoch + 1)]
        return highest * share[0], highest * share[1]

    def learn(self, iteration: int, progress: Progress, log: Any) -> None:
        """Pass over all episodes as often as is left to do after ``iteration``, and keep each pass."""
        count, passes = self.count(iteration), self.settings.epochs
        first = self.place.epochs if self.place.iteration == iteration else 0
        self.seen += [SeenEpisode.of(self.store[number], self.student) for number in range(len(self.seen), count)]
        with progress.task(f"Learning {iteration}/{self.settings.iterations}", (passes - first) * count) as task:
            for epoch in range(first, passes):
                steps = learn(self.student, self.optimizer, self.seen, self.settings, iteration, epoch)
                means = self._pass(steps, task, log)
                self._keep(replace(self.place, iteration=iteration, epochs=epoch + 1))
            if first < passes:
                progress.message(f"{passes} passes of iteration {iteration}: {means}")

    def _pass(self, steps: Iterator[tuple[int, dict[str, float]]], task: Task, log: Any) -> Means:
        """Make the updates of a pass, and log their means."""
        means, before, updates = Means(), 0, self.place.updates
        for done, figures in steps:
            task.advance(done - before)
            before, updates = done, updates + 1
            means.add(figures)
        for name, mean in means.items().items():
            log.add_scalar(f"loss/{name}", mean, updates)
        self.place = replace(self.place, updates=updates)
        return means

    def _keep(self, place: Place) -> None:
        self.place = place
        save_checkpoint(self.folder / CHECKPOINT, self.student, self.optimizer, place, self.settings)
