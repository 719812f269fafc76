"""ViewCrafter (Yu et al., TPAMI 2025), the paper's video generator, in its own environment.

25 frames of the captures' colours on the proxy in, the first of them the reference image, and the
same 25 without gaps out. ViewCrafter needs Python 3.9, torch 1.13 and an NVIDIA GPU of 24 GB (14
GB for the small model); it runs in the interpreter that ``R2SEGO_VIEWCRAFTER_PYTHON`` names, on
the repository in ``R2SEGO_VIEWCRAFTER_REPOSITORY``. What runs there is
``workers.models.viewcrafter``.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path

from ...config.settings import GenerationSettings
from ...core.digests import file_identity
from ...core.errors import MachineError
from ...workers.external_environment import named_python
from ...workers.learned_backends import LEARNED_BACKENDS
from ...workers.models.viewcrafter import FRAMES
from ...workers.protocol.program_worker import ProgramWorker, library_command
from .program import program_generator
from .slot import ClipInputs, Generator, Installation

BACKENDS = {"viewcrafter": "ViewCrafter", "viewcrafter_512": "ViewCrafter (512 x 320)"}
ORDER = 1

PYTHON_VARIABLE = LEARNED_BACKENDS["viewcrafter"].variable
REPOSITORY_VARIABLE = "R2SEGO_VIEWCRAFTER_REPOSITORY"
CHECKPOINT_VARIABLE = "R2SEGO_VIEWCRAFTER_CHECKPOINT"
"""Names the weights; without it, they are ``checkpoints/model.ckpt`` in the repository."""

SIZES: Mapping[str, tuple[int, int]] = {"viewcrafter": (1024, 576), "viewcrafter_512": (512, 320)}
"""(width, height) of the frames of each published model, by the setting ``generation.generator``."""

_CURE = (
    f"Set up github.com/Drexubery/ViewCrafter with its weights, set {PYTHON_VARIABLE} to its environment's "
    f"python and {REPOSITORY_VARIABLE} to its folder, or use --set generation.generator=blending."
)
_FILES = ("utils/diffusion_utils.py", "configs/inference_pvd_1024.yaml", "configs/inference_pvd_512.yaml")

_NAME = "ViewCrafter"


def installation(name: str, settings: GenerationSettings) -> Installation:
    """ViewCrafter where the environment names it, known by its weights and its own code that is run.

    Raises MachineError when its environment, repository or weights are not there, or it cannot
    make clips of so many frames.
    """
    command = _command(settings.clip_frames)
    repository, checkpoint = map(Path, command[-2:])
    identity = {
        "checkpoint": file_identity(checkpoint),
        "repository": [file_identity(repository / file) for file in _FILES],
    }
    return Installation(identity, tuple(command), SIZES[name])


def make(installed: Installation, inputs: ClipInputs) -> AbstractContextManager[Generator]:
    """ViewCrafter, asked through files."""
    return program_generator(ProgramWorker(installed.command, _NAME, _CURE), installed, inputs)


def _command(clip_frames: int) -> list[str]:
    """ViewCrafter's worker; the last words are the repository and the weights."""
    if clip_frames != FRAMES:
        raise MachineError(
            f"{_NAME} makes clips of {FRAMES} frames, not of {clip_frames}",
            where="generation.clip_frames",
            cure=f"Use --set generation.clip_frames={FRAMES}.",
        )
    python = named_python(PYTHON_VARIABLE, _NAME, "generation.generator", _CURE)
    repository = Path(os.environ.get(REPOSITORY_VARIABLE, "")).resolve()
    for file in _FILES:
        if not (repository / file).is_file():
            raise MachineError(f"{REPOSITORY_VARIABLE} names no folder with {file}", where=repository, cure=_CURE)
    checkpoint = Path(os.environ.get(CHECKPOINT_VARIABLE, "") or repository / "checkpoints" / "model.ckpt")
    if not checkpoint.is_file():
        raise MachineError(f"the weights of {_NAME} are not there", where=checkpoint, cure=_CURE)
    return library_command(python, "workers.models.viewcrafter", str(repository), str(checkpoint.resolve()))
