"""The generator that the settings ask for: what this machine has of it, and it opened."""

from __future__ import annotations

import importlib
from contextlib import AbstractContextManager
from typing import cast

from ...config.settings import Settings
from ...config.slots import GENERATORS
from ...core.errors import MachineError, of_file
from .slot import ClipInputs, Generator, GeneratorBackend, Installation


def installation_of(settings: Settings) -> Installation:
    """What this machine has of the generator that ``generation.generator`` names, as it is now.

    Of all that has to do with generators, this alone reads the environment: its ``identity`` belongs into
    the step's key, and ``open_generator`` takes the rest, so that what runs is what the key says.
    """
    chosen = settings.generation
    try:
        return _backend(chosen.generator).installation(chosen.generator, chosen)
    except MachineError as error:
        return Installation(None, missing=error)
    except OSError as error:
        return Installation(None, missing=of_file(error))


def open_generator(installed: Installation, inputs: ClipInputs) -> AbstractContextManager[Generator]:
    """The generator that ``inputs.settings`` name; what it started ends with the context.

    ``installed`` is what ``installation_of`` told of it. Raises MachineError when it is not set up on
    this machine.
    """
    if installed.missing is not None:
        raise installed.missing
    return _backend(inputs.settings.generation.generator).make(installed, inputs)


def _backend(name: str) -> GeneratorBackend:
    return cast(GeneratorBackend, importlib.import_module(f".{GENERATORS.module(name)}", __package__))
