"""Generated views accepted or rejected by hand: ``decision.json`` beside a view's ``pose.json``.

It says ``{"accepted": true, "by": "hand"}`` or false, and overrules the gate; the pose stays
the estimated one. ``pose.json`` is the pipeline's and is not edited. Needs the standard
library alone, so Blender's Python reads it.
"""

from __future__ import annotations

import json
from pathlib import Path

from ..core.atomic_files import write_whole
from ..core.errors import GenerationError
from ..core.json_files import read_json

DECISION = "decision.json"
_CURE = 'Delete the file, or write {"accepted": true, "by": "hand"} or false into it.'


def save_decision(view: Path, accepted: bool | None) -> None:
    """Accept or reject the view in the folder ``view`` by hand; None leaves it to the gate again."""
    if accepted is None:
        (view / DECISION).unlink(missing_ok=True)
        return
    write_whole(view / DECISION, json.dumps({"accepted": bool(accepted), "by": "hand"}) + "\n")


def decision_of(view: Path) -> bool | None:
    """What a person decided about the view in the folder ``view``, None when nothing.

    Raises GenerationError when the decision is damaged.
    """
    path = view / DECISION
    if not path.exists():
        return None
    try:
        accepted = read_json(path)["accepted"]
        if not isinstance(accepted, bool):
            raise TypeError("'accepted' is neither true nor false")
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise GenerationError("this decision is damaged", where=path, cure=_CURE) from error
    return accepted


def is_accepted(view: Path, by_gate: bool) -> bool:
    """Whether the view in the folder ``view`` counts: as decided by hand, else ``by_gate``.

    Raises GenerationError when the decision is damaged.
    """
    decided = decision_of(view)
    return by_gate if decided is None else decided
