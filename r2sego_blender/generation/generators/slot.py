"""The slot of the video generator G_theta: what one makes, of what, and what a file of one declares.

A generator is a file of this folder with what ``GeneratorBackend`` lists, beside ``BACKENDS``, its names in
the settings (``config.slots``); nothing else has to know of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ...captures.capture import Capture
from ...config.settings import GenerationSettings, Settings
from ...core.errors import R2SEgoError
from ..conditions.conditions import Condition, Renderer
from ..conditions.point_condition import PointConditions


@dataclass(frozen=True)
class Frame:
    """One generated frame.

    ``image`` (H, W, 3) float32 in [0, 1]; ``confidence`` (H, W) float32 in [0, 1], how far
    each pixel may be trusted; ``program`` says what stands for one that tells none.
    """

    image: np.ndarray
    confidence: np.ndarray


class Generator(Protocol):
    """Makes a clip from a reference capture along structural conditions (Eq. 3).

    ``name`` is what the bundle, the panels and the report call the backend.
    """

    name: str

    def generate(self, reference: int, conditions: Sequence[Condition]) -> list[Frame]:
        """One frame a condition, at the condition's size; the last one is at the target.

        ``reference`` is the index i(v) of the capture whose view the clip starts from; the
        conditions' cameras are in the world frame, so a generator that wants motions
        relative to the reference takes them from ``paths.reference_from_frame``.
        """
        ...


@dataclass(frozen=True)
class ClipInputs:
    """What generators make clips of.

    ``depths`` are the proxy's in each capture and ``observed`` the captures' own reliable ones, (H, W)
    float32 metres of its camera, 0 = unknown; ``renderer`` and ``colours`` make the conditions of a
    generator that wants its own size; what is asked and answered lies in the folder ``scratch`` meanwhile.
    """

    captures: Sequence[Capture]
    depths: Sequence[np.ndarray]
    observed: Sequence[np.ndarray]
    renderer: Renderer
    colours: PointConditions
    settings: Settings
    scratch: Path


@dataclass(frozen=True)
class Installation:
    """What a machine has of a generator.

    ``identity``: what frames depend on beside the settings, in JSON's values, for the key of the step that
    makes them; {} where that is nothing, None where the generator is not set up here, as ``missing`` says.
    ``command`` starts its program, ``size`` is the (width, height) in pixels of the only frames it makes.
    """

    identity: Mapping[str, Any] | None
    command: tuple[str, ...] = ()
    size: tuple[int, int] | None = None
    missing: R2SEgoError | None = None


class GeneratorBackend(Protocol):
    """A file of this folder, as ``registry`` uses it."""

    BACKENDS: Mapping[str, str]

    def installation(self, name: str, settings: GenerationSettings) -> Installation:
        """What this machine has of the generator ``name``; may read environment variables.

        Raises MachineError when it is not set up, OSError for a file of it that cannot be read.
        """
        ...

    def make(self, installed: Installation, inputs: ClipInputs) -> AbstractContextManager[Generator]:
        """The generator, by ``installed`` alone: no environment variable is read again."""
        ...
