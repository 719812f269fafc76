"""The tensors of a motion's file of torch's, read without torch: nothing in the file is run.

Such a file (``torch.save`` from torch 1.6 on) is an archive: a pickle that says what the tensors are called and
how they lie, and their numbers beside it, uncompressed. ``torch.load(weights_only=True)`` has had ways around
it (CVE-2025-32434, CVE-2026-24747), reads behind the end of numbers that were cut off, and takes seconds
to import. Source of the format: torch's ``serialization`` and ``_utils`` modules. Needs NumPy alone.
"""

from __future__ import annotations

import io
import pickle
import struct
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ...core.text_files import open_zip, opened_file

_MOST_WORDS = 1 << 20
_MOST_TEXTS, _LONGEST_TEXT = 1000, 200
_DAMAGE = (EOFError, LookupError, TypeError, ValueError, AttributeError, ArithmeticError, AssertionError)
_STORAGES = {
    "FloatStorage": "<f4",
    "DoubleStorage": "<f8",
    "HalfStorage": "<f2",
    "LongStorage": "<i8",
    "IntStorage": "<i4",
    "ShortStorage": "<i2",
    "CharStorage": "<i1",
    "ByteStorage": "<u1",
    "BoolStorage": "?",
}


def tensors_of(file: Path) -> dict[str, np.ndarray | None]:
    """The tensors, numbers, texts and lists of texts, by their names, not to be written to; None for the rest.

    Raises ``pickle.UnpicklingError`` and those of ``zipfile``: no archive of torch's, more than tensors, or
    damage; TypeError where it holds no mapping of names.
    """
    with opened_file(file) as stream, open_zip(stream, _MOST_WORDS) as archive:
        found = _read(archive)
    if not isinstance(found, Mapping):
        raise TypeError(f"it holds a {type(found).__name__}, not named tensors")
    return {name: _array(value) for name, value in found.items() if isinstance(name, str)}


def _array(value: Any) -> np.ndarray | None:
    texts = value if isinstance(value, (list, tuple)) else [value]
    if len(texts) <= _MOST_TEXTS and all(isinstance(one, str) and len(one) <= _LONGEST_TEXT for one in texts):
        return np.asarray(value, dtype=str)
    return np.asarray(value) if isinstance(value, (np.ndarray, int, float)) else None


def _read(archive: zipfile.ZipFile) -> Any:
    words = [name for name in archive.namelist() if name.endswith("/data.pkl") and name.count("/") == 1]
    if len(words) != 1 or archive.getinfo(words[0]).file_size > _MOST_WORDS:
        raise pickle.UnpicklingError("it has no description of tensors, or too long a one")
    try:
        return _Unpickler(archive, words[0].removesuffix("data.pkl")).load()
    except (*_DAMAGE, struct.error) as error:
        raise pickle.UnpicklingError(f"its description of tensors is damaged: {error}") from error


class _Unpickler(pickle._Unpickler):  # Python's own: the other's memory is as large as a number in the file
    """Knows the few functions that lay out tensors, and no others."""

    # Without what makes or fills other objects, sets and mappings of several names at once among them, or makes
    # room before there is anything to put into it.
    dispatch: ClassVar[dict[int, Any]] = {
        code: step
        for code, step in pickle._Unpickler.dispatch.items()
        if bytes([code])
        not in (
            *(pickle.INST, pickle.OBJ, pickle.NEWOBJ, pickle.NEWOBJ_EX, pickle.BUILD, pickle.BYTEARRAY8),
            *(pickle.EXT1, pickle.EXT2, pickle.EXT4, pickle.NEXT_BUFFER, pickle.READONLY_BUFFER, pickle.PERSID),
            *(pickle.DICT, pickle.EMPTY_SET, pickle.ADDITEMS, pickle.FROZENSET),
        )
    }
    dispatch[pickle.EMPTY_DICT[0]] = lambda self: self.append(_Named())

    def __init__(self, archive: zipfile.ZipFile, folder: str) -> None:
        super().__init__(io.BytesIO(archive.read(f"{folder}data.pkl")))
        self._archive, self._folder = archive, folder
        self._numbers: dict[str, np.ndarray] = {}

    def find_class(self, module: str, name: str) -> Any:
        if module == "torch" and name in _STORAGES:
            return _STORAGES[name]
        if (module, name) not in _FUNCTIONS:
            raise pickle.UnpicklingError(f"it holds {module}.{name}, which is no plain tensor")
        return _FUNCTIONS[module, name]

    def persistent_load(self, told: Any) -> np.ndarray:
        """The numbers (n,) of a file beside the description: all of it, once. Raises ValueError."""
        kind, dtype, key, _, count = told
        if kind != "storage" or dtype not in _STORAGES.values():
            raise ValueError("numbers of an unknown kind")
        member = self._archive.getinfo(f"{self._folder}data/{key}")
        if member.compress_type != zipfile.ZIP_STORED or member.file_size != count * np.dtype(dtype).itemsize:
            raise ValueError(f"{key} has not the {count} numbers that it says")
        if key not in self._numbers:
            self._numbers[key] = np.frombuffer(self._archive.read(member), np.uint8)
        return self._numbers[key].view(dtype)


class _Named(dict[Any, Any]):
    """A mapping by texts or numbers: the hash of a tuple within a tuple, a million times, ends the process."""

    def __setitem__(self, name: Any, value: Any) -> None:
        if not isinstance(name, str | int | float):
            raise TypeError("something is called by what is no name")
        super().__setitem__(name, value)


def _empty_mapping() -> dict[Any, Any]:
    return _Named()


def _tensor(numbers: np.ndarray, begin: int, shape: Sequence[int], steps: Sequence[int], *_: Any) -> np.ndarray:
    """The tensor that lies in ``numbers`` (n,) with these steps, counted in numbers; no copy of them."""
    if not isinstance(numbers, np.ndarray) or len(shape) != len(steps) or min((begin, *shape, *steps)) < 0:
        raise ValueError("a tensor has no such shape")
    # A view may say that it has any number of values.
    if int(np.prod(np.array(shape, object), initial=1)) > len(numbers):
        raise ValueError("a tensor says that it has more numbers than there are")
    if 0 in shape:
        return np.empty(tuple(shape), numbers.dtype)
    if begin + sum((size - 1) * step for size, step in zip(shape, steps, strict=True)) >= len(numbers):
        raise ValueError("a tensor reaches beyond its numbers")
    of_bytes = tuple(step * numbers.itemsize for step in steps)
    return np.lib.stride_tricks.as_strided(numbers[begin:], tuple(shape), of_bytes, writeable=False)


def _parameter(tensor: np.ndarray, *_: Any) -> np.ndarray:
    return tensor


_FUNCTIONS = {
    ("collections", "OrderedDict"): _empty_mapping,
    ("torch._utils", "_rebuild_tensor_v2"): _tensor,
    ("torch._utils", "_rebuild_parameter"): _parameter,
}
