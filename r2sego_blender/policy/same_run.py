"""What is made over hours goes on where it was ended, if nothing that decides it has changed since."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..core.atomic_files import write_whole
from ..core.errors import SettingsError
from ..core.json_files import opened_json

_CURE = "Give another folder, or what was given first."


def begin_or_go_on(file: Path, declared: Mapping[str, Any], what: str) -> None:
    """Write ``declared``, all that decides ``what`` begins here, or check that ``file`` says the same.

    Raises SettingsError where it says something else, or not all of it: then it may be another.
    """
    text = json.dumps(declared, indent=1) + "\n"
    if not file.exists():
        write_whole(file, text)
        return
    with opened_json(file, SettingsError, f"this is no {what} of policies", _CURE) as before:
        now = json.loads(text)
        unknown = [name for name in now if name not in before]
        others = [name for name in now if name in before and before[name] != now[name]]
    if others:
        raise SettingsError(f"another {what} was begun here: {_listed(others)} differ", where=file, cure=_CURE)
    if unknown:
        raise SettingsError(
            f"an older version began this {what} and did not write down its {_listed(unknown)}: it may be another",
            where=file,
            cure="Give another folder.",
        )


def _listed(names: list[str]) -> str:
    return " and ".join(dict.fromkeys(name.removesuffix("_sha256") for name in names))
