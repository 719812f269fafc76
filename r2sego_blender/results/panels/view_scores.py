"""What the sub-panel Views remembers of a round's candidates, for each Blender scene. No bpy.

Arrays have no place in Blender's properties; the bundle is read when it changes, never
while something is drawn.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np

from ...core.errors import SceneError
from .bundle import Bundle, CandidateViews
from .selection_reasons import SelectionReasons, read_reasons, why

_numbers = count(1)
_remembered: dict[int, RoundScores] = {}


@dataclass(frozen=True)
class RoundScores:
    """A round's candidates with their scores and the reasons of the selection.

    ``captures`` are the bundle's captures' names; ``origins`` say which attempt each rollout is,
    empty where they are not known. ``stamp`` is another one when the selection was made anew,
    ``number`` each time it was read.
    """

    bundle_path: str
    stamp: str
    views: CandidateViews
    told: SelectionReasons
    captures: tuple[str, ...]
    origins: tuple[str, ...] = ()
    number: int = field(default_factory=lambda: next(_numbers))

    @staticmethod
    def read(bundle: Bundle, round_index: int) -> RoundScores | None:
        """Those of a round, None when it has no selection yet. Raises SceneError for damage."""
        file = bundle.selection_folder(round_index) / "selection.npz"
        if not file.is_file():
            return None
        stamp = f"{round_index} {file.stat().st_mtime_ns}"
        captures = tuple(view.name for view in bundle.captures())
        return RoundScores(
            str(bundle.path), stamp, bundle.candidates(round_index), read_reasons(bundle, round_index),
            captures, _origins(bundle, round_index),
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self.views.score)

    @property
    def mark(self) -> str:
        """Of which selection of which bundle they are."""
        return f"{self.bundle_path} {self.stamp}"

    @property
    def rollouts(self) -> int:
        """One more than the last rollout's number."""
        return int(self.views.rollout.max(initial=-1)) + 1

    @property
    def best_score(self) -> float:
        """The best score of the round, 1 when all are 0."""
        return float(self.views.score.max(initial=0.0)) or 1.0

    def of_rollout(self, rollout: int) -> np.ndarray:
        """(n,) int: a rollout's candidates in the order of time."""
        members = np.flatnonzero(self.views.rollout == rollout)
        return members[np.argsort(self.views.frame[members], kind="stable")]

    def ranked(self) -> np.ndarray:
        """(R,) int: the eligible survivors, best first; the targets lead."""
        eligible = np.flatnonzero(self.views.rank >= 0)
        return eligible[np.argsort(self.views.rank[eligible], kind="stable")]

    def nearest(self, rollout: int, frame: float) -> int:
        """The rollout's candidate whose frame is nearest to ``frame``, -1 when it has none."""
        members = self.of_rollout(rollout)
        if not len(members):
            return -1
        return int(members[np.argmin(np.abs(self.views.frame[members] - frame))])

    def origin(self, rollout: int) -> str:
        """Which attempt of the round this rollout is, '' where that is not known."""
        return self.origins[rollout] if 0 <= rollout < len(self.origins) else ""

    def why(self, index: int) -> str:
        """Why this candidate is a target or none."""
        return why(self.views, self.told, list(self.captures), index)


def _origins(bundle: Bundle, round_index: int) -> tuple[str, ...]:
    """The successful attempts in words, in their order: candidates count those alone.

    Raises SceneError when ``rollouts.json`` is damaged.
    """
    if bundle.scene.declaration.settings.selection.candidates != "rollouts":
        return ()
    file = bundle.scene.round_folder(round_index) / "rollouts" / "rollouts.json"
    try:
        attempts = json.loads(file.read_text(encoding="utf-8"))["rollouts"]
        return tuple(
            f"Attempt {number}, {attempt['behaviour']}"
            for number, attempt in enumerate(attempts)
            if attempt["success"]
        )
    except FileNotFoundError:
        return ()
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SceneError(
            f"it is damaged: {error!r}", where=file, cure="Run the round again (`r2sego refine`)."
        ) from error


def remember(key: int, scores: RoundScores | None) -> None:
    """Keep what is shown in the Blender scene with this session number; None forgets it."""
    if scores is None:
        _remembered.pop(key, None)
    else:
        _remembered[key] = scores


def remembered(key: int, mark: str = "") -> RoundScores | None:
    """What is kept for the Blender scene with this session number.

    Where nothing is, what is kept for another under that ``mark``: a copied scene has the facts of the
    one it is copied of, but a number of its own.
    """
    if key in _remembered:
        return _remembered[key]
    return next((scores for scores in _remembered.values() if scores.mark == mark), None)


def remembered_in(scene: Any) -> RoundScores | None:
    """What is kept for a Blender scene."""
    return remembered(scene.session_uid, scene.r2sego_views.stamp)


def forget_all() -> None:
    """Forget every scene's."""
    _remembered.clear()
