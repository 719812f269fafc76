"""The commands on splats alone, without a scene: trained, and taken to other formats."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..config.presets import MANY_PHOTOGRAPHS, VANILLA_3DGS
from .options import ANY_PATH, Output, output_options, overrides_of, settings_option


@click.command()
@click.argument("captures", type=ANY_PATH)
@click.option("--out", required=True, type=ANY_PATH, help="The file to write; its suffix is its format.")
@click.option(
    "--poses",
    type=ANY_PATH,
    help="transforms.json, cameras.json (3DGS's too), a COLMAP folder or Polycam's raw export; by default what "
    "CAPTURES holds, else solved.",
)
@click.option("--points", type=ANY_PATH, help="PLY to start from; else those of the poses, or triangulated.")
@click.option("--steps", type=int, help="Short for --set training.steps_per_round=N.")
@click.option("--gaussians", type=int, help="Short for --set training.max_gaussians=N.")
@click.option("--seed", type=int, help="Short for --set seed=N.")
@settings_option
@click.option("--vanilla", is_flag=True, help="The original 3DGS: its settings and densification, no budget (1000000).")
@click.option(
    "--frozen", type=ANY_PATH, help="Views to score on: transforms_test.json, or a cameras.json with a 'frozen' list."
)
@click.option("--hold-out", type=int, metavar="K", help="Score on every K-th image, and do not train on it.")
@output_options("--json", "--json-progress", whole="The result as one JSON object.")
def train(overrides: tuple[str, ...], vanilla: bool, output: Output, **given: Any) -> None:
    """Train splats on the photographs CAPTURES alone: no scene, no robot.

    CAPTURES is a folder of photographs, or a pose file beside them. Images are trained on at up to
    640 pixels a side, with 150000 Gaussians at most in 5000 steps: for more give --gaussians,
    --steps and --set captures.max_side_px=1600.
    """
    from ..evaluation.splat_training import settings_of, train_on_photographs

    short = {"training.steps_per_round": "steps", "training.max_gaussians": "gaussians", "seed": "seed"}
    shorts = {key: value for key, name in short.items() if (value := given.pop(name)) is not None}
    base = VANILLA_3DGS if vanilla else MANY_PHOTOGRAPHS
    training = {f"training.{key}": value for key, value in base.items()}
    settings = settings_of({**training, **overrides_of(overrides), **shorts})
    trained = train_on_photographs(**given, settings=settings, progress=output.progress)
    output.show(trained.to_json(), lambda _: [trained.line()])


class _OfFormats(click.Command):
    """Its help ends with the formats' suffixes, which are looked for when it is asked for."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        from ..splats.formats.registry import SUFFIXES

        formatter.write_paragraph()
        formatter.write_text(f"Suffixes: {', '.join(SUFFIXES)}.")


@click.command(cls=_OfFormats)
@click.argument("source", metavar="IN", type=ANY_PATH)
@click.argument("target", metavar="OUT", type=ANY_PATH)
def convert(source: Path, target: Path) -> None:
    """Write the splats of the file IN as OUT; the suffixes say the formats.

    Of .ply SuperSplat's compressed one is read too.
    """
    from ..core.progress import TerminalProgress
    from ..splats.formats.registry import format_of, load_asset, save_asset

    asset = load_asset(source, TerminalProgress())
    save_asset(target, asset)
    degree = min(asset.degree, format_of(target).degree)
    lost = f"; the file's own {asset.degree} does not fit into {target.suffix}" if degree < asset.degree else ""
    click.echo(f"{target}: {len(asset)} Gaussians of degree {degree}{lost}")


COMMANDS = (train, convert)
