"""The key of a step: a digest of the library's version, what the step takes, and its settings."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Iterable
from typing import Any

from .. import __version__


def step_key(inputs: Iterable[str], settings: Any, digest_of: Callable[[str], str]) -> str:
    """The digest of a step that takes ``inputs``, whose content ``digest_of`` digests, under ``settings``.

    ``settings`` are dataclasses, arrays or JSON values. A field whose metadata says that it changes no
    result is left out.
    """
    state = {
        "version": __version__,
        "inputs": {name: digest_of(name) for name in inputs},
        "parameters": settings,
    }
    text = json.dumps(state, sort_keys=True, default=_as_json)
    return hashlib.sha256(text.encode()).hexdigest()


def _as_json(value: Any) -> Any:
    """A step's settings as its key has them: of a dataclass, the fields that change the result.

    A field ``added`` later is left out while it has its default, so that keys made before it stand.
    """
    if dataclasses.is_dataclass(value):
        return {
            field.name: getattr(value, field.name)
            for field in dataclasses.fields(value)
            if field.metadata.get("changes_result", True)
            and not (field.metadata.get("added") and getattr(value, field.name) == field.default)
        }
    if hasattr(value, "tolist"):
        return value.tolist()
    return str(value)
