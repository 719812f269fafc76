"""Why each candidate view of a round is a target or not, in words with the numbers they compare. No bpy."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ...core.formatting import told_apart
from ...views.selection import Selection

_SUPPRESSOR = re.compile(r"\bframe (\d+) of this rollout\b")


def why(selection: Selection, window: int, captures: Sequence[str], index: int) -> str:
    """One to three sentences: what became of candidate ``index``, and its reference.

    ``window`` is the suppression's in frames; ``captures`` are the captures' names in their order.
    """
    said = selection.reason[index].strip().rstrip(".")
    sentences = [said[:1].upper() + said[1:] + _compared(selection, window, index, said)]
    reference = int(selection.reference[index])
    if 0 <= reference < len(captures):
        seen = selection.overlaps[index]
        sentence = f"Its reference {captures[reference]} sees {seen[reference]:.0%} of it"
        others = [k for k in np.argsort(-seen, kind="stable") if k != reference and seen[k] > 0.0]
        if others:
            sentence += f", then {captures[others[0]]} {seen[others[0]]:.0%}"
        sentences.append(sentence)
    return " ".join(f"{sentence}." for sentence in sentences if sentence)


def suppressor_of(selection: Selection, index: int) -> int:
    """The candidate whose frame suppressed candidate ``index``, -1 when none did."""
    named = _SUPPRESSOR.search(selection.reason[index])
    if named is None:
        return -1
    in_rollout = selection.rollout == selection.rollout[index]
    found = np.flatnonzero(in_rollout & (selection.frame == int(named[1])))
    return int(found[0]) if len(found) else -1


def _compared(selection: Selection, window: int, index: int, said: str) -> str:
    """The numbers that the reason compares."""
    score, better = selection.score[index], suppressor_of(selection, index)
    if better >= 0:
        other = selection.score[better]
        relation = f" ({told_apart(other, score, 3)} against {told_apart(score, other, 3)})"
        distance = abs(int(selection.frame[better]) - int(selection.frame[index]))
        frames = "frame" if distance == 1 else "frames"
        place = f", {distance} {frames} away, within the window of {window}"
        target = f"; that is target {selection.rank[better] + 1}" if selection.chosen[better] else ""
        return relation + place + target
    if said.startswith("not chosen") and selection.chosen.any():
        last = selection.score[selection.chosen].min()
        return f"; it scores {score:.3f}, the last target {last:.3f}"
    return ""
