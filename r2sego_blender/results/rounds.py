"""A round's results, made where they are not there yet."""

from __future__ import annotations

from ..bundle.layout import of_round
from ..bundle.scene import Scene
from ..core.errors import SettingsError
from ..core.progress import SILENT, Progress
from ..pipeline import refine


def advance(scene: Scene, round_index: int | None, step: str, progress: Progress = SILENT) -> int:
    """Refine the scene as far as a step of a round, such as ``rollouts``; the round.

    By default it is the first round that is not done, else the last. Raises SettingsError where the
    scene declares no such round.
    """
    rounds = scene.declaration.settings.rounds
    index = min(scene.rounds_done(), rounds - 1) if round_index is None else round_index
    if not 0 <= index < rounds:
        raise SettingsError(
            f"there is no round {index}",
            where="--round",
            cure=f"Give 0 to {rounds - 1}; the scene declares {rounds} rounds.",
        )
    refine(scene, progress, until=of_round(index, step))
    return index
