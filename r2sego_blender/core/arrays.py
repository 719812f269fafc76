"""Arrays in ``.npz`` and ``.npy`` files: written under the exact name, bounded before they are read.

NumPy's own reader allocates what a header says before it looks at what the file holds, and takes apart
what was packed a thousand times smaller. Needs NumPy alone.
"""

from __future__ import annotations

import contextlib
import math
import os
import sys
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO

import numpy as np

from .errors import R2SEgoError, may_not_be_read
from .text_files import open_zip, opened_file

_DAMAGE = (
    OSError,
    EOFError,
    KeyError,
    TypeError,
    ValueError,
    AttributeError,
    ArithmeticError,
    RuntimeError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What reading a cut-off, overwritten or foreign file raises."""

_NO_HEADER = (
    tokenize.TokenError,
    SyntaxError,
    LookupError,
    TypeError,
    AttributeError,
    ArithmeticError,
    MemoryError,
    RecursionError,
)
"""What NumPy raises for the literals that a header may be, besides ValueError."""

_MOST_UNPACKED = 192 << 20
_MOST_TIMES_UNPACKED = 10
"""So many bytes may become of a packed file, or so many times its size if that is more."""

_MOST_ARRAYS, _MOST_LIST_BYTES = 65_536, 8 << 20
_READ_BYTES = 1 << 20
_KINDS = "biufUS"  # numbers and text; no objects, which are pickled


def save_arrays(path: Path, **arrays: np.ndarray | str) -> None:
    """Write an uncompressed ``.npz`` that is called ``path``, whatever its suffix.

    The bytes are ``np.savez``'s, which leaves its archive open where a disk is full: as that is collected,
    Python prints a traceback behind the error's message.
    """
    with zipfile.ZipFile(path, "w") as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", mode="w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.asanyarray(array), allow_pickle=False)


class Arrays(Mapping[str, np.ndarray]):
    """The arrays of an ``.npz`` by name, each read when it is asked for. Get one from ``arrays_of``."""

    def __init__(self, archive: zipfile.ZipFile, file_bytes: int) -> None:
        self._archive = archive
        members = archive.infolist()
        unpacked = sum(member.file_size for member in members)
        if len(members) > _MOST_ARRAYS:
            raise ValueError(f"it has more than {_MOST_ARRAYS} arrays")
        if unpacked > max(_MOST_UNPACKED, _MOST_TIMES_UNPACKED * file_bytes):
            raise ValueError(f"it has {file_bytes} bytes and says that {unpacked} are in it")
        self._members = {member.filename.removesuffix(".npy"): member for member in members}

    @property
    def files(self) -> list[str]:
        """The arrays' names, as NumPy calls them."""
        return list(self._members)

    def __getitem__(self, name: str) -> np.ndarray:
        """The array ``name``. Raises KeyError and ValueError, and what damaged archives raise."""
        member = self._members[name]
        if member.flag_bits & 1:
            raise ValueError(f"{name} is encrypted")
        with self._archive.open(member) as stream:
            return _read_array(stream, member.file_size)

    def __iter__(self) -> Iterator[str]:
        return iter(self._members)

    def __len__(self) -> int:
        return len(self._members)


@contextlib.contextmanager
def arrays_of(file: Path | IO[bytes]) -> Iterator[Arrays]:
    """The arrays of an ``.npz``; nothing pickled is ever read.

    Raises OSError, ValueError, ``zipfile.BadZipFile`` and others of ``opened_arrays``' damage.
    """
    with contextlib.ExitStack() as stack:
        stream = stack.enter_context(opened_file(file)) if isinstance(file, Path) else file
        size = stream.seek(0, os.SEEK_END)
        yield Arrays(stack.enter_context(open_zip(stream, _MOST_LIST_BYTES)), size)


@contextlib.contextmanager
def opened_arrays(
    path: Path, error: type[R2SEgoError], what: str, cure: str = "Run `r2sego refine` again."
) -> Iterator[Arrays]:
    """The arrays of the ``.npz`` at ``path`` by name; nothing pickled is ever read.

    Whatever damage is met inside the ``with`` raises ``error`` with the file's name and cure.
    """
    try:
        with arrays_of(path) as data:
            yield data
    except PermissionError as cause:
        raise may_not_be_read(path, error) from cause
    except _DAMAGE as cause:
        raise error(what, where=path, cure=cure) from cause


def load_array(file: Path) -> np.ndarray:
    """The array of an ``.npy``. Raises OSError and ValueError."""
    with opened_file(file) as stream:
        return _read_array(stream, os.fstat(stream.fileno()).st_size)


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


def require_between(low: float, high: float | None, **arrays: np.ndarray) -> None:
    """Raises ValueError, as damage in ``opened_arrays``, where a number is less, more or none."""
    for name, array in arrays.items():
        if array.size and not (low <= array.min() and (high is None or array.max() <= high)):
            raise ValueError(f"{name} are not all from {low} to {high}")


def require_indices(count: int, **arrays: np.ndarray) -> None:
    """Raises ValueError, as damage in ``opened_arrays``, where one is no whole number from 0 to below ``count``."""
    for name, array in arrays.items():
        if array.dtype.kind not in "iu" or (array.size and not 0 <= array.min() <= array.max() < count):
            raise ValueError(f"{name} are no indices of {count}")


def _read_array(stream: IO[bytes], size: int) -> np.ndarray:
    """The array that ``size`` bytes hold. Raises ValueError where they hold another number of values."""
    try:
        version = np.lib.format.read_magic(stream)
        if version == (1, 0):
            shape, by_column, dtype = np.lib.format.read_array_header_1_0(stream)
        else:
            shape, by_column, dtype = np.lib.format.read_array_header_2_0(stream)
    except _NO_HEADER as error:
        raise ValueError("it has no header of an array") from error
    if dtype.kind not in _KINDS or dtype.itemsize < 1 or dtype.subdtype is not None:
        raise ValueError(f"it holds {dtype}, which are no numbers")
    if min(shape, default=0) < 0:
        raise ValueError(f"it has the shape {shape}")
    values, header_bytes = math.prod(shape), stream.tell()
    if values * dtype.itemsize != size - header_bytes:
        raise ValueError(f"it says that it has the shape {shape}, and has {size} bytes")
    array = np.empty(values, dtype)
    _fill(array.view(np.uint8), stream)
    if dtype.kind == "U" and array.view(dtype.str[0] + "u4").max(initial=0) > sys.maxunicode:
        raise ValueError("it holds text of letters that there are not")
    return array.reshape(shape[::-1]).T if by_column else array.reshape(shape)


def _fill(place: np.ndarray, stream: IO[bytes]) -> None:
    """Read bytes until ``place`` is full, a little at a time: an unpacking stream makes copies."""
    for begin in range(0, len(place), _READ_BYTES):
        part = place[begin : begin + _READ_BYTES]
        data = stream.read(len(part))
        if len(data) != len(part):
            raise ValueError("it is cut off")
        part[:] = np.frombuffer(data, np.uint8)
