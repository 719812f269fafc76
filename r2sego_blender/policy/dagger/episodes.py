"""Recorded episodes: pictures in files that are mapped into memory, the rest beside them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.arrays import opened_arrays, require_finite, require_indices, require_shapes, save_arrays
from ...core.atomic_files import UNFINISHED, remove, rename, swap_in
from ...core.errors import MachineError
from ..student.targets import PICTURE_SHAPE, POSE_SIZE, SEAT_TARGETS


@dataclass(frozen=True)
class Outcome:
    """How an episode ended; ``failure`` is empty for a success."""

    seed: int
    failure: str
    steps: int
    mean_assist_n: float


@dataclass(frozen=True)
class Episode:
    """T steps of an episode, each with what the teacher would have done.

    ``pictures`` (T, 96, 128, 3) uint8; ``proprio`` (T, P), ``actions`` (T, 4) of the teacher, ``seat``
    (T, SEAT_TARGETS), nan for none, and ``base_poses`` (T, POSE_SIZE): float32.
    """

    pictures: np.ndarray
    proprio: np.ndarray
    actions: np.ndarray
    seat: np.ndarray
    base_poses: np.ndarray
    outcome: Outcome

    def __len__(self) -> int:
        return len(self.actions)


_PICTURES, _REST = "pictures.raw", "steps.npz"
_DAMAGED = "the recorded episode is damaged"
_CURE = "Remove the folder: the episode is made again."


class EpisodeStore:
    """Episodes by their numbers, each a folder in ``folder`` that is there whole or not at all."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        for left in folder.glob(f"{UNFINISHED}*"):
            remove(left)

    def __contains__(self, number: int) -> bool:
        return self._place(number).is_dir()

    def add(self, number: int, episode: Episode) -> None:
        """Keep an episode as ``number``, in place of what was there."""
        made = self._folder / f"{UNFINISHED}{number:06d}"
        remove(made)
        made.mkdir()
        episode.pictures.tofile(made / _PICTURES)
        outcome = episode.outcome
        save_arrays(
            made / _REST,
            proprio=episode.proprio,
            actions=episode.actions,
            seat=episode.seat,
            base_poses=episode.base_poses,
            seed=np.array([outcome.seed]),
            mean_assist_n=np.array([outcome.mean_assist_n]),
            failure=np.array(outcome.failure),
        )
        # Whoever cuts the power loses episodes, which are made again; a flush for each would take longer.
        (swap_in if self._place(number).exists() else rename)(made, self._place(number))

    def __getitem__(self, number: int) -> Episode:
        """The episode ``number``, its pictures mapped. Raises MachineError where its files are damaged."""
        place = self._place(number)
        with opened_arrays(place / _REST, MachineError, _DAMAGED, _CURE) as arrays:
            steps = {"proprio": "T P", "actions": "T 4", "seat": f"T {SEAT_TARGETS}", "base_poses": f"T {POSE_SIZE}"}
            shapes = {**steps, "seed": "1", "mean_assist_n": "1"}
            rest = {name: arrays[name] for name in shapes}
            require_shapes(rest, **shapes)
            known = np.where(np.isnan(rest["seat"]), 0.0, rest["seat"])
            require_finite(proprio=rest["proprio"], actions=rest["actions"], seat=known, base_poses=rest["base_poses"])
            require_finite(mean_assist_n=rest["mean_assist_n"])
            require_indices(1 << 63, seed=rest["seed"])
            failure, assist_n = str(arrays["failure"]), float(rest["mean_assist_n"][0])
            outcome = Outcome(int(rest["seed"][0]), failure, len(known), assist_n)
        pictures = _mapped(place / _PICTURES, (len(rest["actions"]), *PICTURE_SHAPE))
        return Episode(pictures, rest["proprio"], rest["actions"], rest["seat"], rest["base_poses"], outcome)

    def _place(self, number: int) -> Path:
        return self._folder / f"{number:06d}"


def _mapped(file: Path, shape: tuple[int, ...]) -> np.ndarray:
    try:
        if file.stat().st_size == math.prod(shape) > 0:
            return np.memmap(file, np.uint8, "r", shape=shape)
    except OSError as error:
        raise MachineError(_DAMAGED, where=file, cure=_CURE) from error
    raise MachineError(_DAMAGED, where=file, cure=_CURE)
