"""LPIPS-Alex (Zhang et al., 2018), when its weights are at hand.

Two files are needed, which this project does not ship: AlexNet's state dict as torchvision
names it (``alexnet-*.pth``) and the linear heads of version 0.1 (``lpips_lin_alex*.pth``
or ``alex.pth``). A person puts both into a folder and names it in the environment variable
``R2SEGO_LPIPS_WEIGHTS``. Without them the score is None, never a substitute, and torch, which
takes a second and 180 MB, is not loaded.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from ...core.printable import printable

if TYPE_CHECKING:
    from .network import Lpips

WEIGHTS_VARIABLE = "R2SEGO_LPIPS_WEIGHTS"
_BACKBONE_NAMES = ("alexnet*.pth",)
_HEADS_NAMES = ("lpips_lin_alex*.pth", "alex.pth")


def find_lpips(folder: Path | None = None) -> tuple[Lpips | None, str]:
    """LPIPS with the weights of ``folder`` (or of R2SEGO_LPIPS_WEIGHTS), or None and why."""
    folder = folder or named_folder()
    if folder is None:
        return None, f"AlexNet weights not at hand (name their folder in {WEIGHTS_VARIABLE})"
    backbone, heads = lpips_files(folder)
    if backbone is None:
        return None, f"AlexNet weights not at hand (no {_BACKBONE_NAMES[0]} in {folder})"
    if heads is None:
        return None, f"LPIPS heads not at hand (no {' or '.join(_HEADS_NAMES)} in {folder})"
    from .network import Lpips

    try:
        return Lpips.load(backbone, heads), ""
    except Exception as error:  # PyTorch raises anything on damaged files
        first_line = printable((str(error).splitlines() or [type(error).__name__])[0])
        return None, f"LPIPS weights in {folder} cannot be used: {first_line}"


def named_folder() -> Path | None:
    """The folder of weights that R2SEGO_LPIPS_WEIGHTS names."""
    named = os.environ.get(WEIGHTS_VARIABLE)
    return Path(named) if named else None


def lpips_files(folder: Path) -> tuple[Path | None, Path | None]:
    """AlexNet's file and that of the heads in ``folder``, None for what is not there."""
    return _first(folder, _BACKBONE_NAMES), _first(folder, _HEADS_NAMES)


def _first(folder: Path, patterns: tuple[str, ...]) -> Path | None:
    found = (path for pattern in patterns for path in sorted(folder.glob(pattern)) if path.is_file())
    return next(found, None)
