"""The key of a step: a digest of the library's version, what the step takes, and its settings."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Iterable
from typing import Any

from .. import __version__
from ..config.fields import in_keys


def step_key(inputs: Iterable[str], settings: Any, digest_of: Callable[[str], str]) -> str:
    """The digest of a step that takes ``inputs``, whose content ``digest_of`` digests, under ``settings``.

    ``settings`` are dataclasses (of which ``config.fields.in_keys`` says what counts), arrays or JSON values.
    """
    state = {"version": __version__, "inputs": {name: digest_of(name) for name in inputs}, "parameters": settings}
    text = json.dumps(state, sort_keys=True, default=_as_json)
    return hashlib.sha256(text.encode()).hexdigest()


def _as_json(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return in_keys(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    return str(value)
