"""``r2sego bench …``: measuring speed on this machine, and results against ground truth."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import click

from ..config.presets import PRESETS
from ..core.errors import MachineError
from ..core.progress import TerminalProgress
from . import bench_defaults as defaults
from .options import ANY_PATH, FOLDER, Commands, overrides_of, settings_option


@click.group(cls=Commands)
def bench() -> None:
    """Time the parts of the method on this machine, and score them against ground truth."""


def _measure(name: str, file: Path | None, **given: Any) -> None:
    """Run ``tools.benchmarks.<name>`` with the options given, tell its figures, write them to ``file``."""
    benchmark = _of_checkout(name)
    chosen = {option: value for option, value in given.items() if value is not None}
    figures = getattr(benchmark, f"bench_{name}")(**chosen, progress=TerminalProgress())
    click.echo("\n".join(benchmark.lines(figures)))
    if file is not None:
        _of_checkout("figures").write_figures(file, figures)


def _of_checkout(name: str) -> ModuleType:
    """``tools.benchmarks.<name>``: measuring is no part of the library, a checkout holds it beside it."""
    root = Path(__file__).resolve().parents[2]
    if not (root / "tools" / "benchmarks").is_dir():
        raise MachineError(
            "the benchmarks are not installed with the library",
            where=root,
            cure="Run `r2sego bench` from a checkout, after `make install`.",
        )
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    return importlib.import_module(f"tools.benchmarks.{name}")


_figures_file = click.option("--json", "file", type=ANY_PATH, help="Write the figures to this file.")


def _number(name: str, default: int, words: str) -> Callable[[Any], Any]:
    """An option that is a whole number and tells its default."""
    return click.option(name, type=int, default=default, show_default=True, help=words)


@bench.command("splats")
@click.option("--gaussians", type=int, help=f"Gaussians of a made-up room; {defaults.SPLATS_GAUSSIANS} by default.")
@click.option("--asset", type=ANY_PATH, help="Splats to measure in place of the room, with --cameras.")
@click.option("--cameras", type=ANY_PATH, help="cameras.json: its frozen views, or its captures.")
@click.option(
    "--size", metavar="WxH", help=f"Size of the images; by default that of --cameras, or {defaults.SIZE} of the room."
)
@click.option("--threads", type=int, help="Threads to use; all by default.")
@_number("--repeats", defaults.SPLATS_REPEATS, "Times each step is measured.")
@_figures_file
def bench_splats(file: Path | None, **given: Any) -> None:
    """Time rendering and a training step of splats, beside the least they could take."""
    _measure("splats", file, **given)


@bench.command("training")
@click.argument("captures", type=ANY_PATH)
@click.option("--poses", type=ANY_PATH, help="As for train: by default what CAPTURES holds, else solved.")
@click.option(
    "--points", type=ANY_PATH, help="PLY both trainings start from; else the points of the poses, or triangulated ones."
)
@click.option(
    "--hold-out",
    type=int,
    metavar="K",
    default=defaults.TRAINING_HOLD_OUT,
    show_default=True,
    help="Score on every K-th image, and do not train on it.",
)
@_number("--gaussians", defaults.TRAINING_GAUSSIANS, "Gaussians of the plain training.")
@_number("--steps", defaults.TRAINING_STEPS, "Steps of the plain training.")
@_figures_file
def bench_training(file: Path | None, **given: Any) -> None:
    """Train on CAPTURES plainly, then as usual until the held-out views are as good."""
    _measure("training", file, **given)


@bench.command("geometry")
@click.option("--scene", required=True, type=FOLDER, help="Folder with cameras.json, captures and their ground truth.")
@click.option("--library", type=ANY_PATH, help="Another scene's .glb: its meshes beside the true objects'.")
@_figures_file
@click.option("--seed", type=int, default=0, show_default=True, help="Of the pipeline and the noise.")
@click.option("--no-noise", is_flag=True, help="Leave out the stereo of disturbed captures.")
def bench_geometry(scene: Path, library: Path | None, file: Path | None, seed: int, no_noise: bool) -> None:
    """Time stereo and geometry proxy of a scene whose truth is known, and score them against it."""
    _measure("geometry", file, scene=scene, library=library, seed=seed, noise=not no_noise)


@bench.command("conditions")
@_number("--triangles", defaults.CONDITIONS_TRIANGLES, "Triangles of a made-up room.")
@click.option("--size", metavar="WxH", default=defaults.SIZE, show_default=True, help="Size of the images.")
@_number("--repeats", defaults.CONDITIONS_REPEATS, "Times each pass is measured; the least counts.")
@_figures_file
def bench_conditions(file: Path | None, **given: Any) -> None:
    """Time the structural conditions of a clip: each pass, the colours of the captures, the files."""
    _measure("conditions", file, **given)


@bench.command("generation")
@click.option("--scene", required=True, type=FOLDER, help="Folder with cameras.json, captures and their ground truth.")
@click.option("--bundle", type=FOLDER, help="A bundle of these captures with a proxy; else one is made.")
@click.option("--library", type=ANY_PATH, help="Another scene's .glb: its meshes beside the true objects'.")
@_figures_file
@click.option("--seed", type=int, default=0, show_default=True, help="Of the pipeline.")
@_number("--clips", defaults.GENERATION_CLIPS, "Whole clips made to see how steady they are.")
def bench_generation(file: Path | None, **given: Any) -> None:
    """Time the embedded generator, and score it at the frozen poses of a scene with known truth."""
    _measure("generation", file, **given)


@bench.command("solving")
@click.argument("captures", type=ANY_PATH)
@click.option("--poses", type=ANY_PATH, help="As for train: by default what CAPTURES holds.")
@_number("--first", 0, "The first photograph of the walk that is taken.")
@_number("--count", defaults.SOLVING_COUNT, "So many are taken at most.")
@_number("--every", 1, "Each so-many-th of the walk.")
@click.option("--turn", type=float, default=0.0, help="Each turned so many degrees further than the last at least.")
@_figures_file
def bench_solving(file: Path | None, **given: Any) -> None:
    """Solve photographs whose poses are known without them, by each matcher, and score poses and lens."""
    _measure("solving", file, **given)


@bench.command("registration")
@click.option("--scene", required=True, type=FOLDER, help="Folder with cameras.json, captures and their ground truth.")
@click.option("--bundle", type=FOLDER, help="A bundle of these captures with a proxy; else one is made.")
@_figures_file
@click.option("--seed", type=int, default=0, show_default=True, help="Of the pipeline and of what drifts.")
def bench_registration(file: Path | None, **given: Any) -> None:
    """Register frames at the frozen poses of a scene with known truth, by each registrar, and score their poses."""
    _measure("registration", file, **given)


@bench.command("refinement")
@click.option("--scene", required=True, type=FOLDER, help="Folder with cameras.json: captures and frozen views.")
@click.option(
    "--bundle",
    type=FOLDER,
    help="Where the bundle is made and stays, or goes on if it is there; by default a temporary one.",
)
@click.option("--library", type=ANY_PATH, help="Another scene's .glb: its meshes beside the true objects'.")
@click.option("--preset", type=click.Choice(list(PRESETS)), help="By default the bundle's: at first 'paper'.")
@settings_option
@_figures_file
def bench_refinement(overrides: tuple[str, ...], file: Path | None, **given: Any) -> None:
    """Refine a scene, and score every round and vanilla 3DGS on its frozen views."""
    _measure("refinement", file, overrides=overrides_of(overrides) or None, **given)


@bench.command("rollouts")
@click.option("--scene", type=FOLDER, help="A bundle, or photographs and cameras.json; else a made-up room.")
@click.option("--robot", help="embedded:humanoid, embedded:wheeled, or an MJCF or URDF file; else the scene's.")
@click.option(
    "--scope",
    "scopes",
    multiple=True,
    metavar="NAME|FILE",
    help="Behaviour scope; repeatable. By default walk_and_look and sit_down.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the rollouts.")
@_number("--candidates", defaults.ROLLOUTS_CANDIDATES, "Views that are scored.")
@_figures_file
def bench_rollouts(scopes: tuple[str, ...], file: Path | None, **given: Any) -> None:
    """Time successful rollouts of a scope, and the scoring of a round's candidate views."""
    _measure("rollouts", file, scopes=scopes or None, **given)


@bench.command("policy")
@click.option("--scene", type=FOLDER, help="A refined bundle; else a made-up room.")
@_number("--gaussians", defaults.POLICY_GAUSSIANS, "Gaussians of the made-up room.")
@_number("--steps", defaults.POLICY_STEPS, "Steps of an environment that are timed.")
@_number("--processes", defaults.POLICY_PROCESSES, "Environments side by side, each in a process; 1: none.")
@_figures_file
def bench_policy(file: Path | None, **given: Any) -> None:
    """Time the environments that policies are trained in, and head pictures of many simulations at once."""
    from ..policy.packages import policy_package

    policy_package("gymnasium")
    _measure("policy", file, **given)


@bench.command("scaling")
@click.option("--bundle", type=FOLDER, required=True, help="A refined bundle, whose steps' seconds count.")
@_number("--scenes", defaults.SCALING_SCENES, "Scenes that sleep for these seconds.")
@_number("--slots", defaults.SCALING_SLOTS, "How many of them at once.")
@_number("--faster", defaults.SCALING_FASTER, "How many times as fast they sleep.")
@_figures_file
def bench_scaling(file: Path | None, **given: Any) -> None:
    """Reckon what many scenes take by the seconds of one, and see whether the scheduler keeps that."""
    _measure("scaling", file, **given)


@bench.command("cluster")
@_number("--cells", defaults.CLUSTER_CELLS, "Cells that sleep on four nodes.")
@click.option(
    "--seconds", type=float, default=defaults.CLUSTER_SECONDS, show_default=True, help="How long each of them sleeps."
)
@_figures_file
def bench_cluster(file: Path | None, **given: Any) -> None:
    """Run cells on Ray nodes of this machine, kill a node and the experiment, and count what was done."""
    _measure("cluster", file, **given)


@bench.command("shards")
@_number("--frames", defaults.SHARED_FRAMES, "Frames that Blenders share.")
@_number("--workers", defaults.SHARED_WORKERS, "Blenders, each pip's bpy with Cycles.")
@_number("--triangles", defaults.CONDITIONS_TRIANGLES, "Triangles of a made-up room.")
@click.option("--size", default=defaults.SHARED_SIZE, show_default=True, help="Width x height of the images.")
@_figures_file
def bench_shards(file: Path | None, **given: Any) -> None:
    """Render conditions by several Blenders that share the frames: how fast, and whether each frame once."""
    _measure("shards", file, **given)


COMMANDS = (bench,)
