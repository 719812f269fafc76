"""Recorded episodes: pictures in files that are mapped into memory, the rest beside them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.arrays import opened_arrays, require_finite, require_shapes, save_arrays
from ...core.atomic_files import UNFINISHED, remove, rename, swap_in
from ...core.errors import MachineError, R2SEgoError
from ..student.targets import SEAT_TARGETS


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
    (T, SEAT_TARGETS), nan for none: float32.
    """

    pictures: np.ndarray
    proprio: np.ndarray
    actions: np.ndarray
    seat: np.ndarray
    outcome: Outcome

    def __len__(self) -> int:
        return len(self.actions)


_PICTURES, _REST = "pictures.npy", "steps.npz"
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
        np.save(made / _PICTURES, episode.pictures)
        outcome = episode.outcome
        save_arrays(
            made / _REST,
            proprio=episode.proprio,
            actions=episode.actions,
            seat=episode.seat,
            outcome=np.array([outcome.seed, outcome.steps, outcome.mean_assist_n]),
            failure=np.array(outcome.failure),
        )
        # Whoever cuts the power loses episodes, which are made again; a flush for each would take longer.
        (swap_in if self._place(number).exists() else rename)(made, self._place(number))

    def __getitem__(self, number: int) -> Episode:
        """The episode ``number``, its pictures mapped. Raises MachineError where its files are damaged."""
        place = self._place(number)
        with opened_arrays(place / _REST, MachineError, _DAMAGED, _CURE) as arrays:
            rest = {name: arrays[name] for name in ("proprio", "actions", "seat", "outcome")}
            require_shapes(rest, proprio="T P", actions="T 4", seat=f"T {SEAT_TARGETS}", outcome="3")
            require_finite(proprio=rest["proprio"], actions=rest["actions"], outcome=rest["outcome"])
            seed, steps, assist = rest["outcome"].tolist()
            outcome = Outcome(int(seed), str(arrays["failure"]), int(steps), assist)
        pictures = self._pictures(place / _PICTURES)
        if len(pictures) != len(rest["actions"]):
            raise self._damaged(place / _PICTURES)
        return Episode(pictures, rest["proprio"], rest["actions"], rest["seat"], outcome)

    def _pictures(self, file: Path) -> np.ndarray:
        try:
            pictures = np.lib.format.open_memmap(file, mode="r")
        except (OSError, ValueError, EOFError, SyntaxError) as error:
            raise self._damaged(file) from error
        if pictures.ndim != 4 or pictures.dtype != np.uint8:
            raise self._damaged(file)
        return pictures

    def _place(self, number: int) -> Path:
        return self._folder / f"{number:06d}"

    @staticmethod
    def _damaged(file: Path) -> R2SEgoError:
        return MachineError(_DAMAGED, where=file, cure=_CURE)
