"""What a worker answered, read as a stranger's: bounded, whole, by its digests, and never of random weights."""

from __future__ import annotations

import re
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.arrays import load_array
from ...core.errors import MachineError, NativeError
from ...core.json_files import finite_number, parse_json
from ...core.printable import printable
from ...core.text_files import read_text
from .serving import PROTOCOL, RANDOM, RESPONSE_FILE, file_digest, plain_path

_MOST_RECORD = 16 << 20
_SHA256 = re.compile(r"[0-9a-f]{64}")
_LONGEST_NAME, _LONGEST_WORDS = 200, 300


class RefusedRequestError(NativeError):
    """A worker that declined one request, and may answer the next."""


@dataclass(frozen=True)
class Limits:
    """What an answer may take: seconds in all, seconds without a sign of life, bytes and files."""

    seconds: float = 3600.0
    silent_s: float = 900.0
    answer_bytes: int = 1 << 30
    files: int = 4096


@dataclass(frozen=True)
class Response:
    """A worker's answer.

    ``backend`` has its version; ``weights`` is the SHA-256 of the model's, or "" where it has none. ``values``
    are JSON's. ``files``: each output's place, by name. ``worker`` is where errors are, ``cure`` what they advise.
    """

    task: str
    backend: str
    weights: str
    seconds: float
    values: Mapping[str, Any]
    files: Mapping[str, Path]
    shapes: Mapping[str, tuple[str, tuple[int, ...]]]
    worker: str
    cure: str

    def file(self, name: str) -> Path:
        """The output ``name``. Raises NativeError where there is none."""
        if name not in self.files:
            raise self.wrong(f"answered without {name}")
        return self.files[name]

    def array(self, name: str, shape: tuple[int | None, ...], kinds: str = "f") -> np.ndarray:
        """The output ``name`` as an array of a ``shape``, in which None is any size; numbers are finite.

        ``kinds`` are NumPy's of its dtype, such as "f" or "iu". Raises NativeError for any other.
        """
        file = self.file(name)
        if name not in self.shapes:
            raise self.wrong(f"gave {name} as a file, not as an array")
        told, has = self.shapes[name]
        fits = len(has) == len(shape) and all(a is None or a == b for a, b in zip(shape, has, strict=True))
        if not fits or np.dtype(told).kind not in kinds:
            wanted = " x ".join("any" if one is None else str(one) for one in shape)
            raise self.wrong(f"gave {name} as {told} {' x '.join(map(str, has))}, not {kinds} {wanted}")
        try:
            array = load_array(file)
        except (OSError, ValueError) as error:
            raise self.wrong(f"gave {name} that cannot be read: {error}") from error
        if (array.dtype.str, array.shape) != (told, has):
            raise self.wrong(f"gave {name} of another size than it said")
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise self.wrong(f"gave {name} with values that are no numbers")
        return array

    def listed(self, name: str) -> list[Mapping[str, Any]]:
        """The value ``name`` as a list of objects. Raises NativeError for any other."""
        listed = self.values.get(name)
        if not (isinstance(listed, list) and all(isinstance(one, dict) for one in listed)):
            raise self.wrong(f"gave no list of {name}")
        return listed

    def wrong(self, what: str) -> NativeError:
        """The error that this answer is one of those."""
        return NativeError(f"{self.backend or 'the worker'} {what}", where=self.worker, cure=self.cure)


def read_response(
    folder: Path, task: str, worker: str, cure: str, limits: Limits, *, allow_random: bool = False
) -> Response:
    """The response in ``folder``, its outputs held against their digests; links are never followed.

    ``worker`` is where errors are, ``cure`` what they advise. Raises NativeError for an answer that is damaged,
    of another protocol or task, too large or, unless ``allow_random``, of random weights; its kind
    RefusedRequestError where the worker declined; MachineError for what the worker says its machine lacks.
    """
    try:
        _require_bounds(folder, limits)
        record = parse_json(read_text(_regular(folder, RESPONSE_FILE), _MOST_RECORD))
        if record["protocol"] != PROTOCOL:
            raise ValueError(f"it follows protocol {record['protocol']}, this R2S-EGO {PROTOCOL}")
        if "error" in record:
            raise _told(record["error"], worker, cure)
        if record["task"] != task:
            raise ValueError(f"it is of the task {record['task']}, not {task}")
        backend, weights = record["backend"], record["weights"]
        if not (isinstance(backend, str) and backend.strip() and isinstance(weights, str)):
            raise ValueError("it does not say what backend and weights it is of")
        if weights == RANDOM:
            if not allow_random:
                raise ValueError("it is of random weights, and no model's")
        elif weights and not _SHA256.fullmatch(weights):
            raise ValueError("its weights have no digest")
        files, shapes = {}, {}
        for name, one in record["outputs"].items():
            files[plain_path(name)] = file = _regular(folder, one["file"])
            if file_digest(file) != one["sha256"]:
                raise ValueError(f"{name} is not what was said of it")
            if "shape" in one:
                shapes[name] = np.dtype(one["dtype"]).str, tuple(int(size) for size in one["shape"])
        values = record["values"]
        if not isinstance(values, dict):
            raise ValueError("its values have no names")
        seconds = finite_number(record["seconds"])
    except (OSError, LookupError, TypeError, ValueError, AttributeError, SyntaxError) as error:
        what = f"the answer of the worker cannot be used: {printable(str(error), _LONGEST_WORDS)}"
        raise NativeError(what, where=worker, cure=cure) from error
    backend = printable(backend.strip(), _LONGEST_NAME)
    return Response(task, backend, weights, seconds, values, files, shapes, worker, cure)


def content_size(folder: Path) -> tuple[int, int]:
    """Bytes and files in a folder at this moment, links not followed."""
    found = [path.lstat() for path in folder.rglob("*")]
    return sum(one.st_size for one in found), len(found)


def _require_bounds(folder: Path, limits: Limits) -> None:
    has, files = content_size(folder)
    if has > limits.answer_bytes or files > limits.files:
        raise ValueError(f"it has {has} bytes in {files} files, of at most {limits.answer_bytes} in {limits.files}")


def _regular(folder: Path, path: Any) -> Path:
    """A file within ``folder`` that is reached without a link. Raises ValueError and OSError."""
    place = folder
    for part in plain_path(path).split("/"):
        place = place / part
        if stat.S_ISLNK(place.lstat().st_mode):
            raise ValueError(f"{path} is a link")
    if not stat.S_ISREG(place.lstat().st_mode):
        raise ValueError(f"{path} is no file")
    return place


def _told(error: Mapping[str, Any], worker: str, cure: str) -> MachineError | NativeError:
    """What the worker says went wrong."""
    kind, what = str(error["kind"]), str(error["what"]).strip().rstrip(".")[:_LONGEST_WORDS]
    advice = str(error.get("cure") or cure)[:_LONGEST_WORDS]
    if kind == "unusable":
        return MachineError(what, where=worker, cure=advice)
    if kind == "refused":
        return RefusedRequestError(f"the worker refused, {what}", where=worker, cure=advice)
    return NativeError(f"the worker broke: {what}", where=worker, cure=advice)
