"""``r2sego select`` and ``views``: a round's target views, and the views generated at them."""

from __future__ import annotations

from pathlib import Path

import click

from ..bundle.scene import Scene
from .options import ANY_PATH, FIRST_NOT_DONE, Output, output_options, round_option


@click.command()
@click.argument("scene", type=ANY_PATH)
@round_option(FIRST_NOT_DONE)
@click.option("--explain", is_flag=True, help="Every candidate with its scores, and why it is no target.")
@output_options("--json", "--json-progress")
def select(scene: Path, round_index: int | None, explain: bool, output: Output) -> None:
    """Bring SCENE to a round's target views, and say what they are and why.

    Runs the steps of refine up to there, as far as they are not done.
    """
    from ..results.rounds import advance
    from ..results.selection_report import describe_selection, lines

    opened = Scene.open(scene)  # after the imports, which take seconds: it may be corrected meanwhile
    index = advance(opened, round_index, "selection", output.progress)
    output.show(describe_selection(opened, index, explain), lines)


@click.command()
@click.argument("scene", type=ANY_PATH)
@round_option()
@click.option("--accept", type=int, multiple=True, metavar="K", help="Train on view K; repeatable.")
@click.option("--reject", type=int, multiple=True, metavar="K", help="Do not train on view K; repeatable.")
@click.option(
    "--undecided", type=int, multiple=True, metavar="K", help="Let view K's figures decide again; repeatable."
)
@output_options("--json", "--json-progress")
def views(scene: Path, round_index: int | None, output: Output, **given: tuple[int, ...]) -> None:
    """List SCENE's generated views of a round; accept or reject some by hand.

    View 0 is the target of rank 1, and so on. What was decided counts from the next refine on, which
    trains the asset again.
    """
    from ..editing.view_decisions import decide_views, describe_views, lines

    opened = Scene.open(scene)
    index = max(opened.newest_round("views"), 0) if round_index is None else round_index
    if any(given.values()):
        decide_views(opened, index, **given)
    output.show(describe_views(opened, index), lines)


COMMANDS = (select, views)
