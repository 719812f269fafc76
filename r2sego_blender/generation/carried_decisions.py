"""What a person decided of views, carried over to those that are generated in their place.

A decision is about what the view shows: it holds where the same camera was asked for and the proxy
looks the same from there, to the bit. Needs the standard library alone.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..core.digests import content_digest
from ..core.errors import GenerationError
from ..core.json_files import read_json
from .decisions import DECISION, decision_of, save_decision

_WORDS = {True: "accepted", False: "rejected"}


def carry_decisions(before: Path, after: Path) -> list[str]:
    """Write the decisions on the views in ``before`` beside the views of ``after`` that show the same.

    Both are folders as ``rounds/<l>/views``. Returns in words which decisions were dropped, and why.
    """
    made = {shown: view for view in _views(after) if (shown := _what_it_shows(view)) is not None}
    dropped = []
    for view in _views(before):
        if not (view / DECISION).exists():
            continue
        try:
            decided = decision_of(view)
        except GenerationError:
            dropped.append(f"view {int(view.name)}: what was decided of it by hand is damaged and dropped")
            continue
        shown = _what_it_shows(view)
        now = made.get(shown) if shown is not None else None
        if now is not None and not (decided and _record(now)["estimate"] is None):
            save_decision(now, decided)
            continue
        assert decided is not None  # of a decision that is there
        why = "no view shows the same now" if now is None else "no pose could be estimated for it now"
        dropped.append(f"view {int(view.name)}: that it was {_WORDS[decided]} by hand is dropped, {why}")
    return dropped


def _views(folder: Path) -> list[Path]:
    return [file.parent for file in sorted(folder.glob("[0-9][0-9][0-9]/pose.json"))]


def _what_it_shows(view: Path) -> tuple[str, str] | None:
    """The camera asked for, and the digest of its condition; None where they are not there any more."""
    conditions = sorted((view / "conditions").glob("[0-9][0-9][0-9].exr"))
    try:
        query = json.dumps(_record(view)["query"], sort_keys=True)
        return query, content_digest(conditions[-1])
    except (OSError, ValueError, KeyError, TypeError, IndexError):
        return None


def _record(view: Path) -> dict[str, Any]:
    return read_json(view / "pose.json")
