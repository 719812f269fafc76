"""What a round's selection came to: the target views, and why every other candidate is none."""

from __future__ import annotations

from itertools import groupby
from typing import Any

from ..bundle.layout import of_round
from ..bundle.scene import Scene
from ..captures.store import CAPTURES
from ..core.errors import GenerationError
from ..views.selection import SELECTION, Selection


def describe_selection(scene: Scene, round_index: int, explain: bool = False) -> dict[str, Any]:
    """A round's selection, JSON-ready. Raises GenerationError where there is none of the scene's captures.

    ``targets`` are the target views, best first, each with its reference's name and what
    the captures see of it, the greatest share first; ``photographs`` are those to take next.
    With ``explain`` the ``candidates`` are there too, rollout by rollout. A share is from 0 to 1.
    """
    selection = scene.read(SELECTION.of_round(round_index)).selection
    names = [capture.name for capture in scene.read(CAPTURES)]
    seen_by = selection.overlaps.shape[1]
    if seen_by not in (0, len(names)):
        raise GenerationError(
            f"this selection was made with {seen_by} captures, and the scene has {len(names)}",
            where=scene.path / of_round(round_index, "selection"),
            cure="Run `r2sego refine` again.",
        )
    candidates = [_candidate(selection, index, names) for index in range(len(selection.score))]
    described = {
        "scene": str(scene.path),
        "round": round_index,
        "budget": selection.budget,
        "window": scene.declaration.settings.selection.nms_window,
        "scale": scene.declaration.settings.selection.scoring_scale,
        "ablations": list(selection.ablations),
        "scored": len(candidates),
        "survived": int(selection.survived.sum()),
        "mean_deficit": float(selection.deficit.mean()),
        "mean_availability": float(selection.availability.mean()),
        "note": selection.note,
        "photographs": [one.to_json() for one in selection.photographs],
        "targets": [candidates[index] for index in selection.targets],
    }
    if explain:
        described["candidates"] = sorted(candidates, key=lambda c: (c["rollout"], c["frame"]))
    return described


def lines(described: dict[str, Any]) -> list[str]:
    """The target views as lines for a person, and the candidates where they are described too."""
    d = described
    chosen = f"{len(d['targets'])} target views of {d['scored']} candidates"
    survived = f"{d['survived']} survive suppression within {d['window']} frames"
    missing = f"the asset misses {d['mean_deficit']:.1%} of a view (u)"
    available = f"the proxy can render {d['mean_availability']:.1%} (g)"
    text = [
        f"{d['scene']}, round {d['round']}: {chosen}, {survived}",
        f"on average {missing}, {available}; s = u g; new: of what it misses, what no target before it shows",
    ]
    text += [f"ablation: {ablation}" for ablation in d["ablations"]]
    text += [d["note"]] if d["note"] else []
    text += ["", f"{'rank':>4}{'rollout':>9}{'frame':>7}{'u':>9}{'g':>9}{'s':>9}{'new':>7}  reference, and its overlap"]
    for number, target in enumerate(d["targets"], 1):
        scored = f"{_scores(target)}{target['marginal']:>7.0%}"
        text.append(f"{number:>4}{target['rollout']:>9}{target['frame']:>7}{scored}  {_seen(target)}")
    for rollout, members in groupby(d.get("candidates", ()), key=lambda c: c["rollout"]):
        text += ["", *_explained(rollout, list(members))]
    return text


def _explained(rollout: int, members: list[dict[str, Any]]) -> list[str]:
    """A rollout's candidates; those that were chosen are marked."""
    best = max(members, key=lambda c: c["score"])
    chosen = sum(c["chosen"] for c in members)
    best_is = f"the best score is {best['score']:.3f} at frame {best['frame']}"
    text = [
        f"rollout {rollout}: {len(members)} candidates, {chosen} chosen; {best_is}",
        f" {'frame':>7}{'u':>9}{'g':>9}{'s':>9}",
    ]
    for c in members:
        mark = "*" if c["chosen"] else " "
        text.append(f"{mark}{c['frame']:>7}{_scores(c)}  {c['reason']}")
    return text


def _scores(candidate: dict[str, Any]) -> str:
    shares = (candidate["deficit"], candidate["availability"])
    return "".join(f"{share:>9.1%}" for share in shares) + f"{candidate['score']:>9.3f}"


def _seen(target: dict[str, Any]) -> str:
    (name, share), *others = target["overlaps"].items()
    others = ", ".join(f"{other} {overlap:.0%}" for other, overlap in others[:2] if overlap > 0.0)
    return f"{name} {share:.0%}" + (f" (then {others})" if others else "")


def _candidate(selection: Selection, index: int, names: list[str]) -> dict[str, Any]:
    """A candidate's entries; its reference by name, and the captures' overlaps where known."""
    entry: dict[str, Any] = selection.described(index)
    reference, overlaps = entry.pop("reference"), entry.pop("overlaps")
    if reference < 0:
        return entry
    # The reference itself stands first among equals.
    order = sorted(range(len(names)), key=lambda k: (-overlaps[k], k != reference))
    return {**entry, "reference": names[reference], "overlaps": {names[k]: overlaps[k] for k in order}}
