"""Acting: episodes that teacher and student drive by turns, labelled, or that the student drives alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import torch

from ...robot.controllers.commanded_drive import DriveLimits
from ...robot.controllers.drive_actions import action_of
from ..environment.state import PrivilegedState
from ..student.network import Acting, Student
from ..student.targets import pose_of, seat_target
from .episodes import Episode, Outcome
from .interfaces import Environment, Observation, Teacher
from .settings import DaggerSettings


class Actor:
    """A student through one episode: it remembers what it saw."""

    def __init__(self, student: Student) -> None:
        self._acting = Acting(student).eval()
        self._state = student.start()

    def act(self, observation: Observation) -> np.ndarray:
        """(4,) float32 in [-1, 1]: what it does of an observation."""
        with torch.inference_mode():
            head = torch.from_numpy(np.array(observation["head"])[None])
            proprio = torch.from_numpy(np.array(observation["proprio"], np.float32)[None])
            action, self._state = self._acting(head, proprio, self._state)
            return action[0].numpy()


def labelled_episode(
    environment: Environment,
    teacher: Teacher,
    student: Student | None,
    beta: float,
    seed: int,
    settings: DaggerSettings,
    limits: DriveLimits,
) -> Episode:
    """Episode ``seed``, of whose turns the teacher drives the share ``beta``; all steps have its labels.

    Without a ``student`` the teacher drives alone.
    """
    rng = np.random.default_rng([settings.seed, seed])
    actor = None if student is None else Actor(student)
    observation, state = environment.reset(seed)
    phase, teacher_drives, done = None, True, False
    steps: list[tuple[np.ndarray, ...]] = []
    while not done:
        command, phase = teacher.label(state, phase)
        label = action_of(command, limits)
        steps.append(_recorded(observation, label, state))
        if len(steps) % settings.turns_steps == 1 or settings.turns_steps == 1:
            teacher_drives = bool(rng.random() < beta)
        own = None if actor is None else actor.act(observation)
        observation, state, done = environment.step(label if own is None or teacher_drives else own)
    return _episode(steps, outcome_of(state, seed, len(steps)))


def labelled_views(environment: Environment, teacher: Teacher, seeds: Sequence[int], limits: DriveLimits) -> Episode:
    """What is seen at the beginning of episodes ``seeds``, every second near the target, as the steps of one."""
    views = []
    for number, seed in enumerate(seeds):
        observation, state = environment.view(seed, near_target=number % 2 == 1)
        views.append(_recorded(observation, action_of(teacher.label(state)[0], limits), state))
    return _episode(views, Outcome(seeds[0], "", len(views), 0.0))


def _episode(steps: Sequence[tuple[np.ndarray, ...]], outcome: Outcome) -> Episode:
    pictures, proprio, actions, seat, base_poses = (np.stack(column) for column in zip(*steps, strict=True))
    return Episode(pictures, proprio, actions, seat, base_poses, outcome)


def _recorded(observation: Observation, label: np.ndarray, state: PrivilegedState) -> tuple[np.ndarray, ...]:
    """Picture, proprioception, action, seat and pose of an Episode's step: the next may write into the same arrays."""
    seen = np.array(observation["head"]), np.array(observation["proprio"], np.float32)
    return *seen, label, seat_target(state), pose_of(state)


def outcomes(environment: Environment, student: Student, seeds: Iterable[int]) -> Iterator[Outcome]:
    """The outcomes of episodes ``seeds`` that the student drives."""
    for seed in seeds:
        actor = Actor(student)
        observation, _ = environment.reset(seed)
        done, steps = False, 0
        while not done:
            observation, state, done = environment.step(actor.act(observation))
            steps += 1
        yield outcome_of(state, seed, steps)


def taught_outcomes(
    environment: Environment, teacher: Teacher, limits: DriveLimits, seeds: Iterable[int]
) -> Iterator[Outcome]:
    """The outcomes of episodes ``seeds`` that the teacher drives."""
    for seed in seeds:
        _, state = environment.reset(seed)
        phase, done, steps = None, False, 0
        while not done:
            command, phase = teacher.label(state, phase)
            _, state, done = environment.step(action_of(command, limits))
            steps += 1
        yield outcome_of(state, seed, steps)


def outcome_of(state: PrivilegedState, seed: int, steps: int) -> Outcome:
    """How an episode ended whose last state is ``state``."""
    return Outcome(seed, state.failure, steps, float(state.mean_assist_n))
