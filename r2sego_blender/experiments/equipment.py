"""What a machine may have to score with, or not: the weights of LPIPS, and methods of others.

It is no part of a cell's key, for machines differ in it: what one scored is not thrown away by another that has less.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from ..bundle.keys import step_key
from ..core.digests import file_identity
from ..core.errors import MachineError
from ..evaluation.arms import ARMS
from ..evaluation.external_arms.external_views import METHODS
from ..evaluation.lpips.weights import BACKBONE_NAMES, HEADS_NAMES, WEIGHTS_VARIABLE

LPIPS = "lpips"
"""Its weights, beside the arms."""


def equipment(arms: Iterable[str]) -> dict[str, str]:
    """What tells LPIPS's weights here from others, and the methods of those ``arms`` that need one; '' for what is not
    set up. Nothing is run for it."""
    return {LPIPS: _weights(), **{arm: _method(arm) for arm in arms if ARMS[arm].views}}


def _weights() -> str:
    folder = Path(os.environ.get(WEIGHTS_VARIABLE) or os.devnull)
    parts = [
        [file_identity(file) for name in names for file in sorted(folder.glob(name)) if file.is_file()]
        for names in (BACKBONE_NAMES, HEADS_NAMES)
    ]
    return step_key((), parts, str) if all(parts) else ""


def _method(arm: str) -> str:
    try:
        installed = METHODS[arm].installation()
    except MachineError:
        return ""
    installed.worker.close()
    return step_key((), installed.identity, str)
