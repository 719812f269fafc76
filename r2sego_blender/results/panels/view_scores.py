"""A round's candidates with their scores and the reasons of the selection, as Views shows them. No bpy."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...robot.rollouts.rollout import REASONS, ROLLOUTS
from ...views.selection import Selection
from .bundle import Bundle, CandidateViews
from .selection_reasons import why


@dataclass(frozen=True)
class RankedView:
    """A target view, or one that may stand in for a target: ``chosen`` tells which."""

    candidate: int
    rollout: int
    frame: int
    score: float
    chosen: bool

    @property
    def name(self) -> str:
        """By what a list finds it."""
        return f"Rollout {self.rollout}, {self.frame}"


@dataclass(frozen=True)
class RoundScores:
    """A round's candidates with their scores and the reasons of the selection.

    ``captures`` are the bundle's captures' names; ``origins`` say which attempt each rollout is,
    empty where they are not known. ``window`` is the suppression's in frames. ``stamp`` is another one
    when the selection was made anew.
    """

    bundle_path: str
    stamp: str
    views: CandidateViews
    window: int
    captures: tuple[str, ...]
    origins: tuple[str, ...] = ()

    @staticmethod
    def read(bundle: Bundle, round_index: int) -> RoundScores | None:
        """Those of a round, None when it has no selection yet. Raises R2SEgoError for damage."""
        file = bundle.selection_folder(round_index) / "selection.npz"
        if not file.is_file():
            return None
        stamp = f"{round_index} {file.stat().st_mtime_ns}"
        captures = tuple(view.name for view in bundle.captures())
        window = bundle.scene.declaration.settings.selection.nms_window
        return RoundScores(
            str(bundle.path), stamp, bundle.candidates(round_index), window, captures, _origins(bundle, round_index)
        )

    def __len__(self) -> int:
        return len(self.selection.score)

    @property
    def selection(self) -> Selection:
        """What became of each candidate."""
        return self.views.selection

    @property
    def mark(self) -> str:
        """Of which selection of which bundle they are."""
        return f"{self.bundle_path} {self.stamp}"

    @cached_property
    def rollouts(self) -> int:
        """One more than the last rollout's number."""
        return int(self.selection.rollout.max(initial=-1)) + 1

    @cached_property
    def survivors(self) -> int:
        """How many temporal suppression left."""
        return int(self.selection.survived.sum())

    @cached_property
    def best(self) -> dict[str, float]:
        """The round's largest deficit ``U``, availability ``G`` and score ``S``."""
        scores = {"U": self.selection.deficit, "G": self.selection.availability, "S": self.selection.score}
        return {key: float(values.max(initial=0.0)) for key, values in scores.items()}

    @property
    def best_score(self) -> float:
        """The best score of the round, 1 when all are 0."""
        return self.best["S"] or 1.0

    @property
    def note(self) -> str:
        """What is out of the ordinary in the selection, '' where nothing is."""
        return " ".join([*self.selection.ablations, self.selection.note]).strip()

    def of_rollout(self, rollout: int) -> np.ndarray:
        """(n,) int: a rollout's candidates in the order of time."""
        members = np.flatnonzero(self.selection.rollout == rollout)
        return members[np.argsort(self.selection.frame[members], kind="stable")]

    @cached_property
    def ranked(self) -> tuple[RankedView, ...]:
        """The eligible survivors, best first; the targets lead."""
        told = self.selection
        return tuple(
            RankedView(int(k), int(told.rollout[k]), int(told.frame[k]), float(told.score[k]), bool(told.chosen[k]))
            for k in told.ranked
        )

    @cached_property
    def row_of(self) -> dict[int, int]:
        """The place of a candidate among the ranked ones."""
        return {one.candidate: row for row, one in enumerate(self.ranked)}

    def nearest(self, rollout: int, frame: float) -> int:
        """The rollout's candidate whose frame is nearest to ``frame``, -1 when it has none."""
        members = self.of_rollout(rollout)
        if not len(members):
            return -1
        return int(members[np.argmin(np.abs(self.selection.frame[members] - frame))])

    def origin(self, rollout: int) -> str:
        """Which attempt of the round this rollout is, '' where that is not known."""
        return self.origins[rollout] if 0 <= rollout < len(self.origins) else ""

    def figures(self, index: int) -> str:
        """A candidate's scores in a line."""
        told = self.selection
        return f"u {told.deficit[index]:.1%}   g {told.availability[index]:.1%}   s {told.score[index]:.3f}"

    def why(self, index: int) -> str:
        """Why this candidate is a target or none."""
        return why(self.selection, self.window, self.captures, index)


def _origins(bundle: Bundle, round_index: int) -> tuple[str, ...]:
    """The successful attempts in words, in their order: candidates count those alone.

    Raises RobotError when they are damaged.
    """
    made = ROLLOUTS.of_round(round_index)
    declared = bundle.scene.declaration.settings.selection.candidates
    if declared != "rollouts" or not (bundle.path / made.name / REASONS).is_file():
        return ()
    return tuple(
        f"Attempt {number}, {attempt.behaviour}" for number, attempt in enumerate(bundle.read(made)) if attempt.success
    )
