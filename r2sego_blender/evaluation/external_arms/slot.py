"""What a method of others is given and gives: it sees captures and cameras, and never a frozen view's photograph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ...captures.capture import Capture
from ...core.cameras import Camera
from ...geometry.stereo.observed_geometry import ObservedGeometry
from ...workers.protocol.asking import Worker
from ...workers.protocol.request import Request

TASK = "views"
"""What a worker of such a method is asked for: outputs ``view_000`` and on, uint8 (H, W, 3), one a camera."""


@dataclass(frozen=True)
class Given:
    """What the other arms have too.

    ``cameras`` are the frozen views', by name and in the world frame, as the captures and the ``observed`` points are;
    ``renderings`` what the arm that this one begins with shows there, (H, W, 3) in [0, 1], empty where it begins with
    none. ``steps`` is the refinement's number of training steps in all.
    """

    captures: Sequence[Capture]
    observed: ObservedGeometry
    cameras: Mapping[str, Camera]
    renderings: Mapping[str, np.ndarray]
    steps: int


@dataclass(frozen=True)
class Installation:
    """A method as this machine has it: what tells it from another, and who answers."""

    identity: Mapping[str, Any]
    worker: Worker


class ExternalArm(Protocol):
    """What a file of this folder offers."""

    def installation(self) -> Installation:
        """The method where the environment names it. Raises MachineError, which says what is missing."""
        ...

    def request(self, given: Given) -> Request:
        """The one request that all its views come of."""
        ...
