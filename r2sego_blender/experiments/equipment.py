"""What a machine may have to score with, or not: the weights of LPIPS, and methods of others.

It is no part of a cell's key, for machines differ in it: what one scored is not thrown away by another that has less.
"""

from __future__ import annotations

from collections.abc import Iterable

from ..bundle.keys import step_key
from ..core.digests import file_identity
from ..core.errors import MachineError
from ..evaluation.arms import ARMS
from ..evaluation.external_arms.external_views import METHODS
from ..evaluation.lpips.weights import lpips_files, named_folder

LPIPS = "lpips"
"""Its weights, beside the arms."""


def equipment(arms: Iterable[str]) -> dict[str, str]:
    """What tells LPIPS's weights here from others, and the methods of those ``arms`` that need one; '' for what is not
    set up. Nothing is run for it."""
    return {LPIPS: _weights(), **{arm: _method(arm) for arm in arms if ARMS[arm].views}}


def _weights() -> str:
    folder = named_folder()
    files = [file for file in lpips_files(folder) if file is not None] if folder is not None else []
    return step_key((), [file_identity(file) for file in files], str) if len(files) == 2 else ""


def _method(arm: str) -> str:
    try:
        installed = METHODS[arm].installation()
    except MachineError:
        return ""
    installed.worker.close()
    return step_key((), installed.identity, str)
