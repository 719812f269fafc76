"""A round's generated views, accepted and rejected by hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..bundle.scene import Scene
from ..core.errors import GenerationError, SettingsError
from ..generation.view_effects import ViewEffect, effects_of_round
from ..generation.view_records import decide, read_views


def decide_views(
    scene: Scene,
    round_index: int,
    accept: Sequence[int] = (),
    reject: Sequence[int] = (),
    undecided: Sequence[int] = (),
) -> None:
    """Accept views of a round, reject some, and let the figures of others decide again, each by its rank.

    Raises SettingsError for a view named twice, GenerationError for one that is not there, is damaged or
    cannot be accepted; changes nothing then.
    """
    given = [*accept, *reject, *undecided]
    if len(set(given)) < len(given):
        raise SettingsError("a view is decided on twice", where="r2sego views", cure="Name each view once.")
    folder = scene.round_folder(round_index) / "views"
    words = ((accept, True), (reject, False), (undecided, None))
    with scene.locked():
        read_views(folder, 0)  # damaged ones are refused before anything changes
        decide(folder, {rank: accepted for ranks, accepted in words for rank in ranks})


def describe_views(scene: Scene, round_index: int) -> dict[str, Any]:
    """The round's generated views, JSON-ready. Raises GenerationError where there are none."""
    budget = scene.declaration.settings.selection.target_views
    folder = scene.round_folder(round_index) / "views"
    records = read_views(folder, budget)
    if not records:
        raise GenerationError(
            f"round {round_index} has no generated views",
            where=folder,
            cure="Run `r2sego refine` first, or choose another round.",
        )
    effects = effects_of_round(scene, round_index)
    views = [record.to_json() for record in records]
    for record, view in zip(records, views, strict=True):
        effect = effects.get(record.rank)
        view["effect"] = None if effect is None else effect.to_json()
    return {
        "scene": str(scene.path),
        "round": round_index,
        "accepted": sum(record.accepted for record in records),
        "views": views,
    }


def lines(described: dict[str, Any]) -> list[str]:
    """What ``describe_views`` says, for a person."""
    views = described["views"]
    count = f"{described['accepted']} of {len(views)} views are trained on"
    text = [f"{described['scene']}, round {described['round']}: {count}", ""]
    text.append(f"{'view':>4}{'rollout':>9}{'frame':>7}  {'':2}reference, and what became of it")
    for view in views:
        mark = "+" if view["accepted"] else "-"
        stands = f", stands in for view {view['replaces']}" if view["replaces"] >= 0 else ""
        effect = f"; {ViewEffect.from_json(view['effect'])}" if view["effect"] else ""
        text.append(
            f"{view['rank']:>4}{view['rollout']:>9}{view['frame']:>7}  {mark} "
            f"{view['reference']}: {view['fate']}{stands}{effect}"
        )
    return text
