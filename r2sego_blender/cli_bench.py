"""``r2sego bench …``: measuring speed on this machine, and results against ground truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .cli_options import ANY_PATH, FOLDER, progress_of


@click.group()
def bench() -> None:
    """Measure the kernels' speed on this machine, and geometry against ground truth."""


@bench.command("splats")
@click.option("--gaussians", type=int, help="Gaussians of a made-up room.")
@click.option("--asset", type=ANY_PATH, help="Splats to measure in its place, with --cameras.")
@click.option("--cameras", type=ANY_PATH, help="cameras.json: its frozen views, or its captures.")
@click.option("--size", metavar="WxH", help="Size of the images.")
@click.option("--threads", type=int, help="Threads to use; all by default.")
@click.option("--repeats", type=int, help="Times each step is measured.")
@click.option("--json", "file", type=ANY_PATH, help="Write the figures to this file.")
@click.pass_context
def bench_splats(context: click.Context, file: Path | None, **given: Any) -> None:
    """Time rendering and a training step of splats, beside the least they could take."""
    from .benchmarks.splats import bench_splats, lines, write_figures

    chosen = {name: value for name, value in given.items() if value is not None}
    figures = bench_splats(**chosen, progress=progress_of(context, as_json=False))
    click.echo("\n".join(lines(figures)))
    if file is not None:
        write_figures(file, figures)


@bench.command("training")
@click.argument("captures", type=ANY_PATH)
@click.option("--poses", type=ANY_PATH, help="As for train.")
@click.option("--points", type=ANY_PATH, help="PLY both trainings start from; as for train.")
@click.option("--hold-out", type=int, metavar="K", help="Score on every K-th image.")
@click.option("--gaussians", type=int, help="Gaussians of the plain training.")
@click.option("--steps", type=int, help="Steps of the plain training.")
@click.option("--json", "file", type=ANY_PATH, help="Write the figures to this file.")
@click.pass_context
def bench_training(context: click.Context, file: Path | None, **given: Any) -> None:
    """Train on CAPTURES plainly, then as usual until the held-out views are as good."""
    from .benchmarks.splats import write_figures
    from .benchmarks.training import bench_training, lines

    chosen = {name: value for name, value in given.items() if value is not None}
    figures = bench_training(**chosen, progress=progress_of(context, as_json=False))
    click.echo("\n".join(lines(figures)))
    if file is not None:
        write_figures(file, figures)


@bench.command("geometry")
@click.option("--scene", required=True, type=FOLDER, help="cameras.json, captures and their ground truth.")
@click.option("--library", type=ANY_PATH, help="Another scene's .glb: its meshes beside the true objects'.")
@click.option("--json", "file", type=ANY_PATH, help="Write the figures to this file.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of the pipeline and the noise.")
@click.option("--no-noise", is_flag=True, help="Leave out the stereo of disturbed captures.")
@click.pass_context
def bench_geometry(
    context: click.Context, scene: Path, library: Path | None, file: Path | None, seed: int, no_noise: bool
) -> None:
    """Time stereo and geometry proxy of a scene whose truth is known, and score them against it."""
    from .benchmarks.geometry import bench_geometry, lines
    from .benchmarks.splats import write_figures

    figures = bench_geometry(scene, library, seed, not no_noise, progress_of(context, as_json=False))
    click.echo("\n".join(lines(figures)))
    if file is not None:
        write_figures(file, figures)


@bench.command("conditions")
@click.option("--triangles", type=int, help="Triangles of a made-up room.")
@click.option("--size", metavar="WxH", help="Size of the images.")
@click.option("--repeats", type=int, help="Times each pass is measured.")
@click.option("--json", "file", type=ANY_PATH, help="Write the figures to this file.")
@click.pass_context
def bench_conditions(context: click.Context, file: Path | None, **given: Any) -> None:
    """Time the structural conditions of a clip: each pass, the colours of the captures, the files."""
    from .benchmarks.conditions import bench_conditions, lines
    from .benchmarks.splats import write_figures

    chosen = {name: value for name, value in given.items() if value is not None}
    figures = bench_conditions(**chosen, progress=progress_of(context, as_json=False))
    click.echo("\n".join(lines(figures)))
    if file is not None:
        write_figures(file, figures)


@bench.command("generation")
@click.option("--scene", required=True, type=FOLDER, help="cameras.json, captures and their ground truth.")
@click.option("--bundle", type=FOLDER, help="A bundle of these captures with a proxy, to save making it.")
@click.option("--library", type=ANY_PATH, help="Another scene's .glb: its meshes beside the true objects'.")
@click.option("--json", "file", type=ANY_PATH, help="Write the figures to this file.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of the pipeline.")
@click.option("--clips", type=int, help="Whole clips made to see how steady they are.")
@click.pass_context
def bench_generation(context: click.Context, file: Path | None, **given: Any) -> None:
    """Time the embedded generator, and score it at the frozen poses of a scene with known truth."""
    from .benchmarks.generation import bench_generation, lines
    from .benchmarks.splats import write_figures

    chosen = {name: value for name, value in given.items() if value is not None}
    figures = bench_generation(**chosen, progress=progress_of(context, as_json=False))
    click.echo("\n".join(lines(figures)))
    if file is not None:
        write_figures(file, figures)


@bench.command("rollouts")
@click.option("--scene", type=FOLDER, help="A bundle, or photographs and cameras.json; else a made-up room.")
@click.option("--robot", help="The robot: an MJCF or URDF file; by default the scene's own.")
@click.option(
    "--scope", "scopes", multiple=True, metavar="NAME|FILE",
    help="Behaviour scope; repeatable. By default walk_and_look and sit_down.",
)  # fmt: skip
@click.option("--seed", type=int, default=0, show_default=True, help="Of the rollouts.")
@click.option("--candidates", type=int, help="Views that are scored.")
@click.option("--json", "file", type=ANY_PATH, help="Write the figures to this file.")
@click.pass_context
def bench_rollouts(context: click.Context, scopes: tuple[str, ...], file: Path | None, **given: Any) -> None:
    """Time successful rollouts of a scope, and the scoring of a round's candidate views."""
    from .benchmarks.rollouts import bench_rollouts, lines
    from .benchmarks.splats import write_figures

    chosen = {name: value for name, value in given.items() if value is not None}
    chosen |= {"scopes": scopes} if scopes else {}
    figures = bench_rollouts(**chosen, progress=progress_of(context, as_json=False))
    click.echo("\n".join(lines(figures)))
    if file is not None:
        write_figures(file, figures)
