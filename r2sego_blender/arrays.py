"""Arrays in ``.npz`` files: written under the exact name, and one error where a file is damaged."""

from __future__ import annotations

import contextlib
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .errors import R2SEgoError

_DAMAGE = (OSError, EOFError, KeyError, TypeError, ValueError, zipfile.BadZipFile, zlib.error)
"""What reading a cut-off, overwritten or foreign file raises."""


def save_arrays(path: Path, **arrays: np.ndarray | str) -> None:
    """Write an uncompressed ``.npz`` that is called ``path``, whatever its suffix."""
    with path.open("wb") as file:
        np.savez(file, **arrays)


@contextlib.contextmanager
def opened_arrays(
    path: Path, error: type[R2SEgoError], what: str, cure: str = "Run `r2sego refine` again."
) -> Iterator[np.lib.npyio.NpzFile]:
    """The arrays of the ``.npz`` at ``path`` by name; nothing pickled is ever read.

    Whatever damage is met inside the ``with`` raises ``error`` with the file's name and cure.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            yield data
    except _DAMAGE as cause:
        raise error(what, where=path, cure=cure) from cause
