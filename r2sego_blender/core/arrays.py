"""Arrays in ``.npz`` files: written under the exact name, and one error where a file is damaged."""

from __future__ import annotations

import contextlib
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from .errors import R2SEgoError, may_not_be_read

_DAMAGE = (OSError, EOFError, KeyError, TypeError, ValueError, zipfile.BadZipFile, zlib.error)
"""What reading a cut-off, overwritten or foreign file raises."""


def save_arrays(path: Path, **arrays: np.ndarray | str) -> None:
    """Write an uncompressed ``.npz`` that is called ``path``, whatever its suffix.

    The bytes are ``np.savez``'s, which leaves its archive open where a disk is full: as that is collected,
    Python prints a traceback behind the error's message.
    """
    with zipfile.ZipFile(path, "w") as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", mode="w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.asanyarray(array), allow_pickle=False)


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
    except PermissionError as cause:
        raise may_not_be_read(path, error) from cause
    except _DAMAGE as cause:
        raise error(what, where=path, cure=cure) from cause


def require_shapes(arrays: Mapping[str, np.ndarray], **axes: str) -> None:
    """Raises ValueError, as damage in ``opened_arrays``, where arrays do not fit together or are no numbers.

    ``axes`` has each array's, as in ``points="P 3", normals="P 3"``: a letter is one number in all of them.
    """
    sizes: dict[str, int] = {}
    for name, letters in axes.items():
        shape, wanted = arrays[name].shape, letters.split()
        known = [
            sizes.setdefault(axis, int(axis) if axis.isdigit() else size)
            for axis, size in zip(wanted, shape, strict=False)
        ]
        if len(shape) != len(wanted) or list(shape) != known:
            raise ValueError(f"{name} has the shape {shape}")
        if arrays[name].dtype.kind not in "biuf":
            raise ValueError(f"{name} holds no numbers")


def require_finite(**arrays: np.ndarray) -> None:
    """Raises ValueError, as damage in ``opened_arrays``, where a number is infinite or none."""
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise ValueError(f"{name} are not all finite")
