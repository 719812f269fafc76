"""``r2sego views``: a round's generated views, accepted and rejected by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..bundle.scene import Scene
from ..core.errors import GenerationError, SettingsError
from ..generation.view_records import decide, read_views
from .options import ANY_PATH, json_progress, progress_of, round_option, show


@click.command()
@click.argument("scene", type=ANY_PATH)
@round_option
@click.option("--accept", type=int, multiple=True, metavar="K", help="Train on view K; repeatable.")
@click.option("--reject", type=int, multiple=True, metavar="K", help="Do not train on view K; repeatable.")
@click.option(
    "--undecided", type=int, multiple=True, metavar="K", help="Let view K's figures decide again; repeatable."
)
@click.option("--json", "as_object", is_flag=True, help="As one JSON object.")
@json_progress
@click.pass_context
def views(
    context: click.Context,
    scene: Path,
    round_index: int | None,
    accept: tuple[int, ...],
    reject: tuple[int, ...],
    undecided: tuple[int, ...],
    as_object: bool,
    as_json: bool,
) -> None:
    """List SCENE's generated views of a round; accept or reject some by hand.

    View 0 is the target of rank 1, and so on. What was decided counts from the next refine on, which
    trains the asset again.
    """
    progress = progress_of(context, as_json)
    given = [*accept, *reject, *undecided]
    if len(set(given)) < len(given):
        raise SettingsError("a view is decided on twice", where="r2sego views", cure="Name each view once.")
    opened = Scene.open(scene)
    index = max(opened.newest_round("views"), 0) if round_index is None else round_index
    folder = opened.round_folder(index) / "views"
    if given:
        words = ((accept, True), (reject, False), (undecided, None))
        with opened.locked():
            read_views(folder, 0)  # damaged ones are refused before anything changes
            decide(folder, {rank: accepted for ranks, accepted in words for rank in ranks})
    show(progress, described(opened, index), lines, as_object)


def described(scene: Scene, round_index: int) -> dict[str, Any]:
    """The round's generated views, JSON-ready. Raises GenerationError where there are none."""
    budget = scene.declaration.settings.selection.target_views
    folder = scene.round_folder(round_index) / "views"
    records = read_views(folder, budget)
    if not records:
        raise GenerationError(
            f"round {round_index} has no generated views", where=folder,
            cure="Run `r2sego refine` first, or choose another round.",
        )  # fmt: skip
    return {
        "scene": str(scene.path), "round": round_index,
        "accepted": sum(record.accepted for record in records),
        "views": [record.to_json() for record in records],
    }  # fmt: skip


def lines(told: dict[str, Any]) -> list[str]:
    """The views as lines for a person."""
    count = f"{told['accepted']} of {len(told['views'])} views are trained on"
    text = [f"{told['scene']}, round {told['round']}: {count}", ""]
    text.append(f"{'view':>4}{'rollout':>9}{'frame':>7}  {'':2}reference, and what became of it")
    for view in told["views"]:
        mark = "+" if view["accepted"] else "-"
        stands = f", stands in for view {view['replaces']}" if view["replaces"] >= 0 else ""
        text.append(
            f"{view['rank']:>4}{view['rollout']:>9}{view['frame']:>7}  {mark} "
            f"{view['reference']}: {view['fate']}{stands}"
        )
    return text
