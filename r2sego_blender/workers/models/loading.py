"""Models in an environment of their own: packages and weights that are there, or words for what is missing."""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..protocol.serving import RANDOM, Request, Task, UnusableError, file_digest, serve

FETCH, CHECK = "--fetch", "--check"
_CURE = "See `r2sego doctor --backends`; `r2sego backend install NAME` says how it is set up."

Load = Callable[[str, bool], Any]
"""A model by the name of its backend, of its weights or, for tests, of random ones."""


@contextlib.contextmanager
def packages_of(label: str) -> Iterator[None]:
    """Around a model's imports. Raises UnusableError where one of its packages is missing."""
    try:
        yield
    except ImportError as error:
        raise UnusableError(f"{label} is not there: {error}", _CURE) from error


def version_of(package: str, series: Sequence[str], label: str, cure: str = _CURE) -> str:
    """The installed version of ``package``, if it is of one of the ``series``, such as "0.1".

    Raises UnusableError for another one: its interface may differ from what was published.
    """
    try:
        version = importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError as error:
        raise UnusableError(f"{label} is not there: no package {package}", cure) from error
    if ".".join(version.split(".")[:2]) not in series:
        raise UnusableError(f"{label} is of version {version}, not of {' or '.join(series)}", cure)
    return version


def device_of(torch: Any) -> str:
    """ "cuda" where torch finds such a device, else "cpu"."""
    return "cuda" if torch.cuda.is_available() else "cpu"


def weights_file(repository: str, file: str, label: str) -> Path:
    """Where the Hugging Face cache has a model's weights; nothing is fetched. Raises UnusableError without them."""
    from huggingface_hub import hf_hub_download

    try:
        return Path(hf_hub_download(repository, file, local_files_only=True))
    except (OSError, ValueError) as error:  # LocalEntryNotFoundError is both
        raise UnusableError(f"the weights of {label}, {repository}, are not on this machine", _CURE) from error


def require_gpu(torch: Any, backend: str) -> None:
    """Raises UnusableError where torch finds no NVIDIA GPU."""
    if not torch.cuda.is_available():
        raise UnusableError(f"{backend} needs an NVIDIA GPU")


def state_digest(torch: Any, model: Any) -> str:
    """SHA-256 over the names and the bytes of all that a torch module has loaded, wherever from."""
    digest = hashlib.sha256()
    for name, tensor in sorted(model.state_dict().items()):
        digest.update(name.encode())
        digest.update(tensor.detach().cpu().contiguous().reshape(-1).view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()


def files_digest(files: Sequence[Path]) -> str:
    """SHA-256 over what several files hold, such as the parts of a model's weights."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(file_digest(file).encode())
    return digest.hexdigest()


def numbers(values: Any) -> np.ndarray:
    """Float64, 0 for what is no number: a camera that a model does not find must not cost its depth."""
    array = np.asarray(values, np.float64)
    return np.where(np.isfinite(array), array, 0.0)


class Loaded:
    """The model of the last request, kept for the next: ``load`` makes it, ``weights`` is where its weights lie."""

    def __init__(self, load: Load, weights: Callable[[str], Path]) -> None:
        self._load, self._weights = load, weights
        self._kept: tuple[tuple[str, bool], Any, str] | None = None

    def model(self, request: Request) -> tuple[Any, str]:
        """The model for a request, and the digest of its weights."""
        asked = request.backend, bool(request.parameters.get("random_weights"))
        if self._kept is None or self._kept[0] != asked:
            self._kept = None  # two need not lie in memory
            digest = RANDOM if asked[1] else file_digest(self._weights(asked[0]))
            self._kept = asked, self._load(*asked), digest
        return self._kept[1:]

    def fetch(self, name: str) -> None:
        """Have the model load, and so fetch, its weights."""
        self._load(name, False)

    def check(self, name: str) -> None:
        """Raises UnusableError where the weights are not there."""
        with packages_of(name):
            self._weights(name)


class Weights(Protocol):
    """What fetches a model's weights, and looks for them, by the name of its backend."""

    def fetch(self, name: str) -> None:
        """Have the model fetch its weights."""
        ...

    def check(self, name: str) -> None:
        """Raises UnusableError where the weights are not there."""
        ...


def run(tasks: Mapping[str, Task], loaded: Weights, arguments: Sequence[str]) -> None:
    """Serve ``tasks`` without a network.

    With ``--fetch NAME`` the model fetches its weights, with ``--check NAME`` they are looked for, and nothing is
    served: what is wrong then is printed, and the exit status 1.
    """
    if FETCH in arguments:
        loaded.fetch(arguments[-1])
        return
    os.environ["HF_HUB_OFFLINE"] = "1"  # before huggingface_hub is imported
    if CHECK in arguments:
        try:
            loaded.check(arguments[-1])
        except UnusableError as error:
            sys.exit(f"{error}")
        return
    serve(tasks)
