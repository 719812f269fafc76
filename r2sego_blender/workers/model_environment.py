"""What programs with a learned model have in common, in the model's own Python: versions, GPU, digests of weights.

Runs under Python 3.9 or later and uses the standard library and ``protocol.serving`` alone.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .protocol.serving import UnusableError, file_digest


def accepted_version(package: str, series: Sequence[str], backend: str) -> str:
    """The installed version of ``package``, if it is of one of the ``series`` such as "0.1".

    Raises UnusableError for another one: its interface may differ from what was published.
    """
    try:
        version = importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError as error:
        raise UnusableError(f"{backend} is not there: no package {package}") from error
    if ".".join(version.split(".")[:2]) not in series:
        raise UnusableError(f"{backend} is of version {version}, and this adapter follows {' and '.join(series)}")
    return version


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
