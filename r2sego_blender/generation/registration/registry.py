"""The registrar that the settings ask for: what this machine has of it, and it opened."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import cast

from ...captures.capture import Capture
from ...config.settings import Settings
from ...config.slots import REGISTRARS
from ...core.errors import MachineError, of_file
from .slot import Installation, Registrar, RegistrarBackend


def registrar_installation(settings: Settings) -> Installation:
    """What this machine has of the registrar that ``registration.registrar`` names, as it is now.

    Its ``identity`` belongs into the step's key, and ``open_registrar`` takes the rest, so that what runs is
    what the key says.
    """
    chosen = settings.registration
    try:
        return _backend(chosen.registrar).installation(chosen.registrar, chosen)
    except MachineError as error:
        return Installation(None, missing=error)
    except OSError as error:
        return Installation(None, missing=of_file(error))


def open_registrar(
    installed: Installation, captures: Sequence[Capture], settings: Settings
) -> AbstractContextManager[Registrar]:
    """The registrar that ``settings`` name; what it started ends with the context.

    ``installed`` is what ``registrar_installation`` told of it. Raises MachineError when it is not set up on
    this machine.
    """
    if installed.missing is not None:
        raise installed.missing
    return _backend(settings.registration.registrar).make(installed, captures, settings)


def _backend(name: str) -> RegistrarBackend:
    return cast(RegistrarBackend, importlib.import_module(f".{REGISTRARS.module(name)}", __package__))
