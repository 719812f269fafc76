"""Why each candidate view of a round is a target or not, from what the selection wrote. No bpy."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.arrays import opened_arrays
from ...core.errors import SceneError
from ...core.formatting import told_apart
from .bundle import Bundle, CandidateViews

_CURE = "Run the round again (`r2sego refine`)."
_SUPPRESSOR = re.compile(r"\bframe (\d+) of this rollout\b")


@dataclass(frozen=True)
class SelectionReasons:
    """What ``selection.json`` says, and what of ``selection.npz`` belongs to it.

    ``reasons`` has a line a candidate; ``references`` (M,) int are captures, -1 where none
    was sought; ``overlaps`` (M, N) float in [0, 1] what each capture sees of the view.
    ``budget`` is K, ``window`` the suppression's in frames; ``note`` and ``ablations`` are
    empty or tell what is out of the ordinary.
    """

    reasons: tuple[str, ...]
    references: np.ndarray
    overlaps: np.ndarray
    budget: int
    window: int
    note: str
    ablations: tuple[str, ...]


def read_reasons(bundle: Bundle, round_index: int) -> SelectionReasons:
    """The reasons of a round's selection. Raises SceneError when they are missing or damaged."""
    folder = bundle.selection_folder(round_index)
    what = "the selection's words cannot be read"
    with opened_arrays(folder / "selection.npz", SceneError, what, _CURE) as data:
        references, overlaps = data["reference"].astype(np.int64), data["overlaps"].astype(np.float64)
    try:
        words = json.loads((folder / "selection.json").read_text(encoding="utf-8"))
        told = SelectionReasons(
            tuple(map(str, words["reasons"])), references, overlaps, int(words["budget"]),
            bundle.scene.declaration.settings.selection.nms_window, str(words["note"]),
            tuple(map(str, words["ablations"])),
        )  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise _damaged(folder / "selection.json", f"{what}: {error!r}") from error
    if not len(told.reasons) == len(references) == len(overlaps):
        raise _damaged(folder, "selection.npz and selection.json do not belong together")
    return told


def why(views: CandidateViews, told: SelectionReasons, captures: list[str], index: int) -> str:
    """One to three sentences: what became of candidate ``index``, and its reference.

    ``captures`` are the captures' names in their order.
    """
    said = told.reasons[index].strip().rstrip(".")
    sentences = [said[:1].upper() + said[1:] + _compared(views, told, index, said)]
    reference = int(told.references[index])
    if 0 <= reference < len(captures):
        seen = told.overlaps[index]
        sentence = f"Its reference {captures[reference]} sees {_share(seen[reference])} of it"
        others = [k for k in np.argsort(-seen, kind="stable") if k != reference and seen[k] > 0.0]
        if others:
            sentence += f", then {captures[others[0]]} {_share(seen[others[0]])}"
        sentences.append(sentence)
    return " ".join(f"{sentence}." for sentence in sentences if sentence)


def suppressor_of(views: CandidateViews, told: SelectionReasons, index: int) -> int:
    """The candidate whose frame suppressed candidate ``index``, -1 when none did."""
    named = _SUPPRESSOR.search(told.reasons[index])
    if named is None:
        return -1
    found = np.flatnonzero((views.rollout == views.rollout[index]) & (views.frame == int(named[1])))
    return int(found[0]) if len(found) else -1


def _compared(views: CandidateViews, told: SelectionReasons, index: int, said: str) -> str:
    """The numbers that the reason compares."""
    score, better = views.score[index], suppressor_of(views, told, index)
    if better >= 0:
        other = views.score[better]
        relation = f" ({told_apart(other, score, 3)} against {told_apart(score, other, 3)})"
        distance = abs(int(views.frame[better]) - int(views.frame[index]))
        frames = "frame" if distance == 1 else "frames"
        place = f", {distance} {frames} away, within the window of {told.window}"
        return (
            relation + place + (f"; that is target {views.rank[better] + 1}" if views.chosen[better] else "")
        )
    if said.startswith("not chosen") and views.chosen.any():
        return f"; it scores {score:.3f}, the last target {views.score[views.chosen].min():.3f}"
    return ""


def _share(share: float) -> str:
    return f"{share:.0%}"


def _damaged(place: Path, what: str) -> SceneError:
    return SceneError(what, where=place, cure=_CURE)
