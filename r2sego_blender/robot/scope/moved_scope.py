"""A behaviour scope carried into another world frame: its region and the place to sit at."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .scope import BehaviourScope
from .scope_file import changed_scope


def moved_scope(scope: BehaviourScope, similarity: np.ndarray, where: Path) -> BehaviourScope:
    """The scope after a (4, 4) similarity of the world; the same where it names no place.

    Places are on the floor: what the similarity lifts off it is dropped. Raises RobotError,
    naming ``where``, when the moved region is none.
    """
    changes: dict[str, Any] = {}
    if not isinstance(scope.region.within, str):
        changes["region.within"] = _moved(scope.region.within, similarity)
    if not isinstance(scope.sit_on.target, str):
        (changes["sit_on.target"],) = _moved([scope.sit_on.target], similarity)
    return changed_scope(scope, changes, where) if changes else scope


def _moved(places, similarity: np.ndarray) -> list[list[float]]:
    points = np.asarray(places, np.float64)
    return (points @ similarity[:2, :2].T + similarity[:2, 3]).tolist()
