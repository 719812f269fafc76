"""ViewCrafter, the paper's video generator, by ``workers.viewcrafter``."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path

from ...config.settings import GenerationSettings
from ...core.digests import file_identity
from ...workers.viewcrafter import CURE, FILES, SIZES, viewcrafter_command
from .program import program_generator
from .slot import ClipInputs, Generator, Installation

BACKENDS = {"viewcrafter": "ViewCrafter", "viewcrafter_512": "ViewCrafter (512 x 320)"}
ORDER = 1


def installation(name: str, settings: GenerationSettings) -> Installation:
    """ViewCrafter where the environment names it, known by its weights and its own code that is run."""
    command = viewcrafter_command(settings.clip_frames)
    repository, checkpoint = map(Path, command[-2:])
    identity = {
        "checkpoint": file_identity(checkpoint),
        "repository": [file_identity(repository / file) for file in FILES],
    }
    return Installation(identity, tuple(command), SIZES[name])


def make(installed: Installation, inputs: ClipInputs) -> AbstractContextManager[Generator]:
    """ViewCrafter, asked through files."""
    return program_generator(installed, inputs, "ViewCrafter", CURE)
