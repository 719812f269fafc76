"""An evaluation that is kept to be looked at: every episode's motion, and what the head saw in some of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.atomic_files import UNFINISHED, flush, remove, swap_in, unwritable
from ..core.errors import SettingsError
from ..core.images import save_image
from ..core.progress import SILENT, Progress
from ..results.policy_evaluation import FILE, PolicyEvaluation, head_folder, picture_name
from ..robot.rollouts.bodies import DESCRIPTION, POSES, SHAPES, save_bodies
from ..robot.rollouts.rollout import ARRAYS, REASONS, Quality, Rollout, save_rollouts
from ..views.head_image import HeadView
from .dagger.bundle_episodes import BundleEpisodes
from .environment.episode import STEP_S
from .training import Task, policy_outcomes

if TYPE_CHECKING:
    from .dagger.evaluation import Evaluation
    from .dagger.interfaces import Observation
    from .environment.environments import SitEnv, WalkEnv
    from .environment.state import PrivilegedState

MOST_EPISODES = 200
"""Recorded at once: the bodies of one are up to 1.5 MB."""

_PICTURED_FIRST, _PICTURED_FAILURES = 3, 6
"""Whose pictures are kept: the first episodes', and those of so many failures after them."""


class RecordedEpisodes(BundleEpisodes):
    """Episodes that are remembered as rollouts, as they end, and pictures of some by the episodes' numbers."""

    def __init__(self, env: SitEnv | WalkEnv, seed: int, driver: str) -> None:
        super().__init__(env)
        self._seed, self._driver = seed, driver
        self.rollouts: list[Rollout] = []
        self.pictures: dict[int, Sequence[np.ndarray]] = {}

    def step(self, action: np.ndarray) -> tuple[Observation, PrivilegedState, bool]:
        """Do ``action`` (4,); the last says whether the episode is over."""
        observation, state, done = super().step(action)
        self._seen(observation)
        if done:
            self._end(state)
        return observation, state, done

    def _begun(self, seed: int, options: dict[str, Any]) -> tuple[Observation, PrivilegedState]:
        observation, state = super()._begun(seed, options)
        self._qpos: list[np.ndarray] = []
        self._heads: list[np.ndarray] = []
        self._seen(observation)
        return observation, state

    def _seen(self, observation: Observation) -> None:
        self._qpos.append(self._env.qpos)
        self._heads.append(np.array(observation["head"]))

    def _end(self, state: PrivilegedState) -> None:
        number, robot, qpos = len(self.rollouts), self._env.scene.robot, np.stack(self._qpos)
        mount = replace(robot.mount, parent_from_camera=self._env.head_view.parent_from_camera)
        self.rollouts.append(
            Rollout(
                success=not state.failure,
                reason=state.failure,
                frame=len(qpos) - 1,
                qpos=qpos,
                times_s=STEP_S * np.arange(len(qpos)),
                camera_poses=robot.camera_poses(qpos, mount),
                seed=(self._seed, number),
                behaviour="sit_on" if self._env.sits else "walk_to",
                detail=self.detail,
                controller=self._driver,
                quality=Quality(assist_n=state.mean_assist_n, seated_s=state.seated_s),
            )
        )
        failures = sum(bool(self.rollouts[one].reason) for one in self.pictures if one >= _PICTURED_FIRST)
        if number < _PICTURED_FIRST or (state.failure and failures < _PICTURED_FAILURES):
            self.pictures[number] = self._heads


def recorded_evaluation(
    task: Task, policy: str | Path, episodes: int, seed: int, folder: Path, progress: Progress = SILENT
) -> Evaluation:
    """``training.evaluate_policy``, kept in ``folder`` in place of the evaluation that was there.

    The folder is written whole, at the end; ``results.policy_evaluation`` says what is in it. Raises SettingsError for
    more than MOST_EPISODES, for a folder of something else or with more in it, and where none can be made, before
    the first episode.
    """
    if episodes > MOST_EPISODES:
        cure = "Give fewer --episodes, or leave --record out."
        raise SettingsError(f"{episodes} episodes are too many: at most {MOST_EPISODES} are recorded", cure=cure)
    if folder.exists() and not (folder / FILE).is_file() and not _is_empty(folder):
        cure = "Give a new one: what is there would be replaced."
        raise SettingsError("this is no folder of a recorded evaluation", where=folder, cure=cure)
    if own := _own_files(folder):
        raise SettingsError("it would be lost: an evaluation replaces its folder", where=own[0], cure="Move it away.")
    env = task.environment()
    place = folder.absolute()
    place.parent.mkdir(parents=True, exist_ok=True)
    if reason := unwritable(place.parent):
        cure = "Choose a folder that can be written."
        raise SettingsError(f"no folder can be made there: {reason}", where=place.parent, cure=cure)
    from .dagger.evaluation import Evaluation

    room = RecordedEpisodes(env, seed, task.driver)
    found = Evaluation.of(policy_outcomes(task, policy, episodes, seed, progress, room))
    told = PolicyEvaluation(
        str(policy),
        task.driver,
        task.asset,
        task.reference,
        task.chairs,
        found.successes,
        found.episodes,
        found.low,
        found.high,
        found.failures,
        found.mean_assist_n,
    )
    made = place.with_name(f"{UNFINISHED}{place.name}")
    remove(made)
    made.mkdir(parents=True)
    try:
        save_rollouts(made, room.rollouts)
        save_bodies(made, env.scene.robot, room.rollouts, HeadView.of(env.scene.robot).lens, made)
        for number, pictures in room.pictures.items():
            head_folder(made, number).mkdir(parents=True)
            for frame, picture in enumerate(pictures):
                save_image(head_folder(made, number) / picture_name(frame), picture)
        told.save(made)
        flush(made)
        swap_in(made, place)
    finally:
        remove(made)
    return found


def _own_files(folder: Path) -> list[Path]:
    """What else a person keeps in the folder of an evaluation."""
    if not folder.is_dir():
        return []
    made = {FILE, ARRAYS, REASONS, SHAPES, POSES, DESCRIPTION, head_folder(folder, 0).parent.name}
    return [one for one in sorted(folder.iterdir()) if one.name not in made and not one.name.startswith(".")]


def _is_empty(folder: Path) -> bool:
    return folder.is_dir() and not any(folder.iterdir())
