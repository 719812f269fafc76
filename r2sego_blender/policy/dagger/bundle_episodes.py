"""A bundle's environments as the loop knows them, with the teacher of each episode's floor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...robot.controllers.commanded_drive import DriveCommand
from ..environment.state import PrivilegedState
from ..teacher.teacher import Teacher
from .interfaces import Observation

if TYPE_CHECKING:
    from ..environment.environments import SitEnv, WalkEnv


class BundleEpisodes:
    """An environment and a teacher, both over ``env``: with a chair, each episode's free floor is its own."""

    def __init__(self, env: SitEnv | WalkEnv) -> None:
        self._env, self._teacher = env, self._teacher_of(env)
        self.limits = env.limits
        """What an action of 1 and of -1 is."""
        self.detail = ""
        """What happened where the present episode failed."""

    def reset(self, seed: int) -> tuple[Observation, PrivilegedState]:
        """Begin episode ``seed``."""
        return self._begun(seed, {})

    def view(self, seed: int, near_target: bool) -> tuple[Observation, PrivilegedState]:
        """Begin episode ``seed`` facing anywhere, and where ``near_target`` from around the seat."""
        return self._begun(seed, {"look_around": "near_target" if near_target else "anywhere"})

    def step(self, action: np.ndarray) -> tuple[Observation, PrivilegedState, bool]:
        """Do ``action`` (4,); the last says whether the episode is over."""
        observation, _, ended, cut_off, info = self._env.step(action)
        self.detail = info["detail"]
        return observation, info["state"], ended or cut_off

    def label(self, state: PrivilegedState, phase: Any = None) -> tuple[DriveCommand, Any]:
        """What the teacher does in ``state`` of the present episode."""
        return self._teacher.label(state, phase)

    def _begun(self, seed: int, options: dict[str, Any]) -> tuple[Observation, PrivilegedState]:
        observation, info = self._env.reset(seed=seed, options=options)
        if self._env.floor is not self._teacher.floor:
            self._teacher = self._teacher_of(self._env)
        return observation, info["state"]

    @staticmethod
    def _teacher_of(env: SitEnv | WalkEnv) -> Teacher:
        return Teacher(env.floor, env.scene.robot.rest_height_m, env.limits)
