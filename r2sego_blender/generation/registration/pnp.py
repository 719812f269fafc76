"""The embedded registrar: the captures' patches, looked for where the query would see them, and PnP."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence

import numpy as np

from ...captures.capture import Capture
from ...config.settings import RegistrationSettings, Settings
from ...core.cameras import Camera
from .landmarks import Landmarks
from .slot import Installation, Registrar

BACKENDS = {"pnp": "embedded: patches of the captures and PnP"}
ORDER = 0


class PnPRegistrar:
    """Says nothing beforehand: the pose comes of the patches alone."""

    name = BACKENDS["pnp"]

    def start(self, image: np.ndarray, query: Camera, reference: int, landmarks: Landmarks) -> Camera | None:
        """See ``Registrar``: about the query."""
        return None


def installation(name: str, settings: RegistrationSettings) -> Installation:
    """The embedded registrar is always there, and depends on its inputs and settings alone."""
    return Installation({})


@contextlib.contextmanager
def make(installed: Installation, captures: Sequence[Capture], settings: Settings) -> Iterator[Registrar]:
    """The embedded registrar."""
    yield PnPRegistrar()
