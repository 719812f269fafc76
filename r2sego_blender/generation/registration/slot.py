"""The slot of the registrar: what tells where a generated frame was taken, before it is refined and judged.

A registrar is a file of this folder with what ``RegistrarBackend`` lists, beside ``BACKENDS``, its names in
the settings (``config.slots``); nothing else has to know of it. Whatever it tells, the captures' patches are
found about it, pose and focal length refined on them and held against the gate (``frame_registration``): no
registrar's word alone becomes a training pose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ...captures.capture import Capture
from ...config.settings import RegistrationSettings, Settings
from ...core.cameras import Camera
from ...core.errors import R2SEgoError
from .landmarks import Landmarks


class Registrar(Protocol):
    """Tells where frames were taken.

    ``name`` is what made it, as bundle and report call it.
    """

    name: str

    def start(self, image: np.ndarray, query: Camera, reference: int, landmarks: Landmarks) -> Camera | None:
        """The camera, in the world, about which a frame's patches are first looked for.

        ``image`` (H, W, 3) float32 in [0, 1], made for the ``query`` camera from the capture of index
        ``reference``. None: where the query would see them. Raises GenerationError or NativeError where it can
        tell nothing of this frame, which costs this frame alone, and MachineError where it can tell of none.
        """
        ...


@dataclass(frozen=True)
class Installation:
    """What a machine has of a registrar.

    ``identity``: what poses depend on beside the settings, in JSON's values, for the key of the step that
    registers; {} where that is nothing, None where the registrar is not set up here, as ``missing`` says.
    ``worker`` is what its ``make`` needs to ask it.
    """

    identity: Mapping[str, Any] | None
    worker: Any = None
    missing: R2SEgoError | None = None


class RegistrarBackend(Protocol):
    """A file of this folder, as ``registry`` uses it."""

    BACKENDS: Mapping[str, str]

    def installation(self, name: str, settings: RegistrationSettings) -> Installation:
        """What this machine has of the registrar ``name``; may read environment variables.

        Raises MachineError when it is not set up, OSError for a file of it that cannot be read.
        """
        ...

    def make(
        self, installed: Installation, captures: Sequence[Capture], settings: Settings
    ) -> AbstractContextManager[Registrar]:
        """The registrar, by ``installed`` alone: no environment variable is read again."""
        ...
