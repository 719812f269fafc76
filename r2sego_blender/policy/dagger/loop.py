"""The loop of DAgger: the teacher's episodes, then mixed ones, learnt again after each iteration."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ...core.progress import SILENT, Progress
from ...robot.controllers.commanded_drive import DriveLimits
from ..packages import policy_package
from ..student.network import Student
from .acting import labelled_episode
from .checkpoints import Place, load_checkpoint, save_checkpoint
from .episodes import EpisodeStore
from .evaluation import Evaluation
from .interfaces import Environment, Teacher
from .learning import Losses, learn, scale_proprio
from .settings import DaggerSettings

CHECKPOINT = "checkpoint.npz"


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
        for iteration in range(run.place.iteration, settings.iterations + 1):
            run.collect(iteration, progress, log)
            run.learn(iteration, progress, log)
    return run.student.eval()


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
    student: Student
    optimizer: torch.optim.Adam
    place: Place

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
        store = EpisodeStore(folder / "episodes")
        return _Run(environment, teacher, settings, limits, folder, store, student, optimizer, place)

    def count(self, iteration: int) -> int:
        """Episodes when those of ``iteration`` are there."""
        return self.settings.teacher_episodes + iteration * self.settings.episodes

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
        if iteration == 0 and self.place == Place():
            scale_proprio(self.student, [self.store[number] for number in numbers])

    def learn(self, iteration: int, progress: Progress, log: Any) -> None:
        """Pass over all episodes as often as is left to do after ``iteration``, and keep each pass."""
        settings, count = self.settings, self.count(iteration)
        first = self.place.epochs if self.place.iteration == iteration else 0
        passes = settings.epochs_of(iteration)
        with progress.task(f"Learning {iteration}/{settings.iterations}", (passes - first) * count) as task:
            for epoch in range(first, passes):
                updates, before, means = self.place.updates, 0, Losses.none()
                for done, losses in learn(self.student, self.optimizer, self.store, count, settings, iteration, epoch):
                    task.advance(done - before)
                    updates, before = updates + 1, done
                    means = means.with_one(losses, updates - self.place.updates)
                for name, value in vars(means).items():
                    log.add_scalar(f"loss/{name}", value, updates)
                self.place = Place(iteration, epoch + 1, updates)
                save_checkpoint(self.folder / CHECKPOINT, self.student, self.optimizer, self.place, settings)
                progress.message(f"pass {epoch + 1}/{passes} of iteration {iteration}: {means}")
