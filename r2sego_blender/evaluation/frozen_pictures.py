"""Which picture of a report is which frozen view's: ``report/frozen.json``."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..bundle.artifacts import Artifact
from ..core.atomic_files import write_whole
from ..core.errors import EvaluationError
from ..core.json_files import opened_json
from .report_data import FrozenView, Picture

FIGURES = "figures"
"""The pictures' folder, in the report's."""

_LIST = "frozen.json"


@dataclass(frozen=True)
class FrozenPictures:
    """The files of a frozen view: the photograph, each arm's picture, and what no capture saw; None for one that is
    not there."""

    truth: Path | None
    arms: Mapping[str, Path | None]
    unseen: Path | None


def write_frozen_pictures(folder: Path, frozen: Sequence[FrozenView], name_of: Callable[[Picture], str]) -> None:
    """Write the list into a report's ``folder``; ``name_of`` is a picture's file in ``FIGURES``, "" without one."""
    listed = {
        view.name: {
            "truth": name_of(view.truth),
            "arms": {one.arm: name_of(one.picture) for one in view.renderings},
            "unseen": name_of(view.unseen),
        }
        for view in frozen
    }
    write_whole(folder / _LIST, json.dumps(listed, indent=1) + "\n")


def read_frozen_pictures(file: Path) -> dict[str, FrozenPictures]:
    """The pictures of each frozen view by its name, as the last report left them.

    Raises EvaluationError where there is no list of them, or a damaged one.
    """

    def place(name: Any) -> Path | None:
        if not isinstance(name, str) or Path(name).name != name:
            raise ValueError("a picture lies elsewhere")
        return file.parent / FIGURES / name if name else None

    with opened_json(file, EvaluationError, "this is no list of pictures", "Run `r2sego evaluate` again.") as data:
        return {
            str(name): FrozenPictures(
                place(one["truth"]), {str(arm): place(made) for arm, made in one["arms"].items()}, place(one["unseen"])
            )
            for name, one in data.items()
        }


FROZEN_PICTURES = Artifact(f"report/{_LIST}", read_frozen_pictures)
"""What the last evaluation showed."""
