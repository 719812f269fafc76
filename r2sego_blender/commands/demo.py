"""``r2sego demo``: the demo room in one command."""

from __future__ import annotations

from pathlib import Path

import click

from ..config.presets import PRESETS
from .options import ANY_PATH, json_progress, overrides_of, progress_of, settings_option, tell


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--preset", type=click.Choice(list(PRESETS)), help="Named settings; preview, or what SCENE has declared."
)
@settings_option
@json_progress
@click.pass_context
def demo(
    context: click.Context, scene: Path, preset: str | None, overrides: tuple[str, ...], as_json: bool
) -> None:
    """Make SCENE of the demo room and refine it; started again, it goes on where it stopped.

    It takes some minutes, with --preset paper 15 and more.
    """
    from .demo_scene import make_demo_scene

    progress = progress_of(context, as_json)
    made = make_demo_scene(scene, preset, overrides_of(overrides), progress)
    tell(progress, scene=str(made.path), asset=str(made.asset_file))
