"""The one command tree: ``r2sego …`` and ``python -m r2sego_blender …``.

Every door of the project (a shell, a button in Blender, a script, CI) comes in here.
Heavy libraries are imported inside the commands, so that ``--help`` and ``status`` answer
at once.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from . import __version__
from .errors import R2SEgoError, SettingsError
from .progress import JsonProgress, Progress, TerminalProgress
from .scene import Scene
from .settings import MANY_PHOTOGRAPHS, PRESETS, VANILLA_3DGS, with_overrides

FOLDER = click.Path(file_okay=False, path_type=Path)
ANY_PATH = click.Path(path_type=Path)


class _Commands(click.Group):
    """A group whose commands turn this project's errors into one line and exit code 1."""

    def invoke(self, context: click.Context) -> Any:
        try:
            return super().invoke(context)
        except R2SEgoError as error:
            if context.obj and context.obj.get("json"):
                JsonProgress().emit(event="error", kind=type(error).__name__, text=str(error))
            click.echo(f"r2sego: {error}", err=True)
            context.exit(1)


@click.group(
    cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(__version__, prog_name="r2sego")
@click.pass_context
def main(context: click.Context) -> None:
    """A handful of photographs becomes a scene a robot can be trained in."""
    context.obj = {}
    _cancel_at_once()


def _progress(context: click.Context, as_json: bool) -> Progress:
    context.obj["json"] = as_json
    return JsonProgress() if as_json else TerminalProgress()


def _json_progress(command: Callable) -> Callable:
    return click.option("--json-progress", "as_json", is_flag=True, help="Tell progress as JSON lines.")(
        command
    )


def _settings_option(command: Callable) -> Callable:
    return click.option(
        "--set", "overrides", multiple=True, metavar="KEY=VALUE",
        help="One setting, as in docs/settings.md; repeatable.",
    )(command)  # fmt: skip


def _round_option(command: Callable) -> Callable:
    return click.option(
        "--round", "round_index", type=int, metavar="L",
        help="The round, from 0; by default the one under way, or the last.",
    )(command)  # fmt: skip


def _scale_options(command: Callable) -> Callable:
    options = (
        click.option(
            "--known-length", metavar="PHOTO:X,Y:X,Y:METRES",
            help="Scale: two pixels of one photograph and their distance.",
        ),
        click.option(
            "--marker-side", type=float, metavar="METRES",
            help="Scale: side of a printed ArUco 4x4_50 marker in the photographs.",
        ),
        click.option(
            "--camera-height", metavar="METRES|robot",
            help="Scale: height of the first photograph's camera above the floor, or of the robot's eye.",
        ),
        click.option(
            "--depth", type=FOLDER,
            help="Scale: depth maps called as the photographs are: 16-bit PNG in mm, or EXR, NPY in metres.",
        ),
    )  # fmt: skip
    for option in reversed(options):
        command = option(command)
    return command


@main.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--captures", required=True, type=FOLDER, help="Folder of photographs, three at least.")
@click.option(
    "--poses",
    type=ANY_PATH,
    help="transforms.json, cameras.json, a COLMAP folder or Polycam's raw export; else they are solved.",
)
@click.option(
    "--robot",
    default="embedded:humanoid",
    show_default=True,
    help="The robot: embedded:humanoid, embedded:wheeled, or an MJCF or URDF file.",
)
@click.option(
    "--scope", default="walk_and_look", show_default=True, help="Behaviour scope: a name or a TOML file."
)
@_scale_options
@_settings_option
@_json_progress
@click.pass_context
def new(
    context: click.Context,
    scene: Path,
    captures: Path,
    poses: Path | None,
    robot: str,
    scope: str,
    overrides: tuple[str, ...],
    as_json: bool,
    **given: Any,
) -> None:
    """Make the bundle SCENE from photographs."""
    from .captures.scale import Scale
    from .creation import create_scene

    progress = _progress(context, as_json)
    scale = _scale(**given, robot=robot, scope=scope, command="new") or Scale.automatic()
    changes = _overrides(overrides)
    settings = with_overrides(changes).captures
    made = create_scene(scene, captures, poses, robot, scope, scale, settings, progress)
    made = made.declare(overrides=changes) if changes else made
    _tell(progress, scene=str(made.path), ground=made.declaration.ground, scale=made.declaration.scale_source)


@main.command()
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--floor",
    multiple=True,
    metavar="PHOTO:X,Y[=PHOTO:X,Y]",
    help="A point of the floor in one photograph of the bundle, or the same spot in several; repeatable: "
    "three tell the floor's tilt, one its height.",
)
@click.option("--up", metavar="X,Y,Z", help="The direction up, as the world is now.")
@click.option("--floor-at", type=float, metavar="METRES", help="Where the floor lies above the z = 0 of now.")
@_scale_options
@_json_progress
@click.pass_context
def register(
    context: click.Context,
    scene: Path,
    floor: tuple[str, ...],
    up: str | None,
    floor_at: float | None,
    as_json: bool,
    **given: Any,
) -> None:
    """Correct SCENE's ground or scale; what depends on it is redone by the next refine."""
    from .captures.floor_points import FloorPoint
    from .correction import correct_registration

    progress = _progress(context, as_json)
    opened = Scene.open(scene)
    made = correct_registration(
        opened,
        floor=[FloorPoint.parse(text) for text in floor],
        up=None if up is None else _direction(up),
        floor_at_m=floor_at,
        scale=_scale(
            **given, robot=opened.declaration.robot, scope=opened.declaration.scope, command="register"
        ),
        progress=progress,
    )
    _tell(progress, scene=str(made.path), ground=made.declaration.ground, scale=made.declaration.scale_source)


@main.command()
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--preset", type=click.Choice(list(PRESETS)), help="Named settings; 'paper' are the paper's own."
)
@_settings_option
@click.option("--rounds", type=int, help="Refinement rounds; short for --set rounds=L.")
@_json_progress
@click.pass_context
def refine(
    context: click.Context,
    scene: Path,
    preset: str | None,
    overrides: tuple[str, ...],
    rounds: int | None,
    as_json: bool,
) -> None:
    """Run Algorithm 1 on SCENE; started again, it goes on where it stopped."""
    progress = _progress(context, as_json)
    opened = Scene.open(scene)
    changes = _overrides(overrides) | ({} if rounds is None else {"rounds": rounds})
    with opened.locked():
        if preset is not None and preset != opened.declaration.preset:
            opened = opened.declare(preset=preset, overrides=changes)
        else:
            opened = opened.declare(overrides={**opened.declaration.overrides, **changes})
        from .evaluation.scene_report import write_scene_report
        from .pipeline import refine as run

        run(opened, progress)
        report = write_scene_report(opened)
    _tell(progress, asset=str(opened.asset_file), collision=str(opened.collision_folder), report=str(report))


@main.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--masks", type=FOLDER, help="Masks of the objects: a folder each, or numbered images.")
@click.option("--find", is_flag=True, help="Take what stands free in the observed geometry for objects.")
@click.option("--segment", metavar="WORDS", help="Let SAM 3 mask what WORDS, with commas between, name.")
@click.option("--library", type=FOLDER, help="Folder of meshes that shapes are looked for in.")
@click.option(
    "--mesh", "meshes", multiple=True, metavar="NAME=FILE", help="An object's own mesh; repeatable."
)
@click.option("--generate", multiple=True, metavar="NAME", help="Let SAM 3D make its mesh; repeatable.")
@click.option("--lock", multiple=True, metavar="NAME", help="Hold an alignment as it is; repeatable.")
@click.option("--unlock", multiple=True, metavar="NAME", help="Align it again; repeatable.")
@click.option("--json", "as_json", is_flag=True, help="As one JSON object.")
def objects(
    scene: Path,
    masks: Path | None,
    find: bool,
    segment: str | None,
    library: Path | None,
    meshes: tuple[str, ...],
    generate: tuple[str, ...],
    lock: tuple[str, ...],
    unlock: tuple[str, ...],
    as_json: bool,
) -> None:
    """Declare SCENE's objects for shape priors, and say what became of them."""
    from .object_priors import declare_objects, describe_objects, lines

    opened = Scene.open(scene)
    if masks or find or segment or library or meshes or generate or lock or unlock:
        files = {name: Path(file) for name, file in _overrides(meshes, "--mesh NAME=FILE").items()}
        declare_objects(
            opened, masks=masks, find=find, vocabulary=(segment or "").split(","), library=library,
            meshes=files, generate=generate, lock=lock, unlock=unlock,
        )  # fmt: skip
    described = describe_objects(Scene.open(scene))
    click.echo(json.dumps(described, indent=1) if as_json else "\n".join(lines(described)))


@main.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--json", "as_json", is_flag=True, help="As one JSON object.")
def status(scene: Path, as_json: bool) -> None:
    """Say what SCENE holds and how far it has come."""
    from .status import describe, lines

    state = describe(Scene.open(scene))
    click.echo(json.dumps(state, indent=1) if as_json else "\n".join(lines(state)))


@main.command()
@click.argument("scene", type=ANY_PATH)
@_round_option
@click.option("--json", "as_object", is_flag=True, help="As one JSON object.")
@_json_progress
@click.pass_context
def rollouts(
    context: click.Context, scene: Path, round_index: int | None, as_object: bool, as_json: bool
) -> None:
    """Bring SCENE to a round's rollouts, and say what became of every attempt."""
    from .rollouts_report import describe_rollouts, lines

    progress = _progress(context, as_json)
    opened, index = _advance(scene, round_index, "rollouts", progress)
    _show(progress, describe_rollouts(opened, index), lines, as_object)


@main.command()
@click.argument("scene", type=ANY_PATH)
@_round_option
@click.option("--explain", is_flag=True, help="Every candidate with its scores, and why it is no target.")
@click.option("--json", "as_object", is_flag=True, help="As one JSON object.")
@_json_progress
@click.pass_context
def select(
    context: click.Context,
    scene: Path,
    round_index: int | None,
    explain: bool,
    as_object: bool,
    as_json: bool,
) -> None:
    """Bring SCENE to a round's target views, and say what they are and why."""
    from .selection_report import describe_selection, lines

    progress = _progress(context, as_json)
    opened, index = _advance(scene, round_index, "selection", progress)
    _show(progress, describe_selection(opened, index, explain), lines, as_object)


@main.command()
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--frozen",
    required=True,
    type=ANY_PATH,
    help="cameras.json with a 'frozen' list, or a folder of held-out photographs.",
)
@_json_progress
@click.pass_context
def evaluate(context: click.Context, scene: Path, frozen: Path, as_json: bool) -> None:
    """Score SCENE on frozen views against vanilla 3DGS; writes report/metrics.json."""
    from .evaluation.scene_evaluation import evaluate_scene, table

    progress = _progress(context, as_json)
    opened = Scene.open(scene)
    with opened.locked():
        metrics = evaluate_scene(opened, frozen, progress)
    if as_json:
        _tell(progress, metrics=metrics)
    else:
        click.echo(table(metrics))
        click.echo(f"report: {opened.report_folder / 'index.html'}")


@main.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--to", "folder", required=True, type=FOLDER, help="Folder to write, made if missing.")
@click.option("--splats", default="", metavar=".SPZ,.GLB", help="The asset in these formats too.")
def export(scene: Path, folder: Path, splats: str) -> None:
    """Copy SCENE's asset, collision surface and proxy to a folder other tools read."""
    from .export import export_scene

    suffixes = [f".{name.strip().lower().lstrip('.')}" for name in splats.split(",") if name.strip()]
    for path in export_scene(Scene.open(scene), folder, suffixes):
        click.echo(path)


@main.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--to", "file", type=ANY_PATH, metavar="FILE.glb", help="By default the bundle's own.")
@click.option("--faces", type=int, metavar="N", help="Short for --set texture.faces=N.")
@click.option("--size", type=int, metavar="PX", help="Short for --set texture.size_px=PX.")
@_settings_option
@_json_progress
@click.pass_context
def texture(
    context: click.Context,
    scene: Path,
    file: Path | None,
    faces: int | None,
    size: int | None,
    overrides: tuple[str, ...],
    as_json: bool,
) -> None:
    """Write SCENE's proxy as one mesh with a texture baked from the captures."""
    from .texture import texture_scene

    progress = _progress(context, as_json)
    opened = Scene.open(scene)
    shorts = {"texture.faces": faces, "texture.size_px": size}
    given = {key: value for key, value in shorts.items() if value is not None}
    settings = with_overrides({**_overrides(overrides), **given}, opened.declaration.settings)
    with opened.locked():
        figures = texture_scene(opened, settings, file, progress)
    if as_json:
        _tell(progress, **figures.to_json())
    else:
        click.echo(figures.line())


@main.command("check-collision")
@click.argument("scene", type=ANY_PATH)
@click.option("--json", "as_object", is_flag=True, help="As one JSON object.")
@_json_progress
@click.pass_context
def check_collision(context: click.Context, scene: Path, as_object: bool, as_json: bool) -> None:
    """Drop spheres on SCENE's collision surface in MuJoCo, and see that the robot stands."""
    from .collision_report import check_scene, lines

    progress = _progress(context, as_json)
    report = check_scene(Scene.open(scene), progress)
    if as_json:
        _tell(progress, **report.to_json())
    else:
        click.echo(json.dumps(report.to_json(), indent=1) if as_object else "\n".join(lines(report)))
    context.exit(0 if report.passed else 1)


@main.command()
@click.argument("captures", type=ANY_PATH)
@click.option("--out", required=True, type=ANY_PATH, help="The asset's file; its suffix is its format.")
@click.option("--poses", type=ANY_PATH, help="As for new; by default what the folder holds.")
@click.option("--points", type=ANY_PATH, help="PLY to start from; else the COLMAP model's, or triangulated.")
@click.option("--steps", type=int, help="Short for --set training.steps_per_round=N.")
@click.option("--gaussians", type=int, help="Short for --set training.max_gaussians=N.")
@click.option("--seed", type=int, help="Short for --set seed=N.")
@_settings_option
@click.option("--vanilla", is_flag=True, help="The original 3DGS: its settings and densification.")
@click.option("--frozen", type=ANY_PATH, help="cameras.json with a 'frozen' list to score on.")
@click.option("--hold-out", type=int, metavar="K", help="Score on every K-th image, and do not train on it.")
@click.option("--json", "as_object", is_flag=True, help="The result as one JSON object.")
@_json_progress
@click.pass_context
def train(
    context: click.Context,
    overrides: tuple[str, ...],
    vanilla: bool,
    as_object: bool,
    as_json: bool,
    **given: Any,
) -> None:
    """Train splats on the photographs CAPTURES alone: no scene, no robot."""
    from .splat_training import settings_of, train_on_photographs

    progress = _progress(context, as_json)
    short = {"training.steps_per_round": "steps", "training.max_gaussians": "gaussians", "seed": "seed"}
    shorts = {key: value for key, name in short.items() if (value := given.pop(name)) is not None}
    base = VANILLA_3DGS if vanilla else MANY_PHOTOGRAPHS
    training = {f"training.{key}": value for key, value in base.items()}
    settings = settings_of({**training, **_overrides(overrides), **shorts})
    trained = train_on_photographs(**given, settings=settings, progress=progress)
    if as_object and not as_json:
        click.echo(json.dumps(trained.to_json(), indent=1))
    elif as_json:
        _tell(progress, **trained.to_json())
    else:
        click.echo(trained.line())


@main.command()
@click.argument("source", metavar="IN", type=ANY_PATH)
@click.argument("target", metavar="OUT", type=ANY_PATH)
def convert(source: Path, target: Path) -> None:
    """Write the splats of the file IN as OUT; the suffixes say the formats."""
    from .splats.formats import load_asset, save_asset

    asset = load_asset(source)
    save_asset(target, asset)
    click.echo(f"{target}: {len(asset)} Gaussians of degree {asset.degree}")


@main.group()
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
    figures = bench_splats(**chosen, progress=_progress(context, as_json=False))
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
    figures = bench_training(**chosen, progress=_progress(context, as_json=False))
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

    figures = bench_geometry(scene, library, seed, not no_noise, _progress(context, as_json=False))
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
    figures = bench_conditions(**chosen, progress=_progress(context, as_json=False))
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
    figures = bench_generation(**chosen, progress=_progress(context, as_json=False))
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
    figures = bench_rollouts(**chosen, progress=_progress(context, as_json=False))
    click.echo("\n".join(lines(figures)))
    if file is not None:
        write_figures(file, figures)


@main.command()
@click.option("--json", "as_json", is_flag=True, help="As one JSON object.")
def doctor(as_json: bool) -> None:
    """Say what is installed, what is missing, what it is for and what it costs."""
    from .doctor import examine, lines

    findings = examine()
    click.echo(json.dumps(findings, indent=1) if as_json else "\n".join(lines(findings)))
    sys.exit(0 if findings["ready"] else 1)


def _advance(scene: Path, round_index: int | None, name: str, progress: Progress) -> tuple[Scene, int]:
    """The scene brought as far as ``name`` of the round, and the round."""
    opened = Scene.open(scene)
    rounds = opened.declaration.settings.rounds
    index = min(opened.rounds_done(), rounds - 1) if round_index is None else round_index
    if not 0 <= index < rounds:
        raise SettingsError(
            f"there is no round {index}", where="--round",
            cure=f"Give 0 to {rounds - 1}; the scene declares {rounds} rounds.",
        )  # fmt: skip
    from .pipeline import refine as run
    from .steps import of_round

    with opened.locked():
        run(opened, progress, until=of_round(index, name))
    return opened, index


def _show(progress: Progress, result: dict[str, Any], lines: Callable, as_object: bool) -> None:
    """A result as a progress event, as one JSON object, or in lines."""
    if isinstance(progress, JsonProgress):
        _tell(progress, **result)
    else:
        click.echo(json.dumps(result, indent=1) if as_object else "\n".join(lines(result)))


def _tell(progress: Progress, **result: Any) -> None:
    if isinstance(progress, JsonProgress):
        progress.emit(event="result", **result)
    else:
        for name, value in result.items():
            progress.message(f"{name}: {value}")


def _scale(
    known_length: str | None,
    marker_side: float | None,
    camera_height: str | None,
    depth: Path | None,
    robot: str,
    scope: str,
    command: str,
) -> Any:
    """The scale the options give; None without any."""
    from .captures.scale import Scale

    given = [option for option in (known_length, marker_side, camera_height, depth) if option is not None]
    if len(given) > 1:
        raise SettingsError(
            "the scale is given twice", where=f"r2sego {command}", cure="Give one of the options."
        )
    if marker_side is not None:
        return Scale.marker(marker_side)
    if depth is not None:
        return Scale.depth(depth)
    if camera_height == "robot":
        from .robot.model import RobotModel
        from .robot.scope import BehaviourScope

        eye = RobotModel.load(*BehaviourScope.load(scope).robot_for(robot))
        return Scale.camera_height(eye.eye_height_m, "robot's eye")
    if camera_height is not None:
        return Scale.camera_height(_number(camera_height, "--camera-height"))
    if known_length is None:
        return None
    try:
        photo, first, second, metres = known_length.rsplit(":", 3)
        pixels = [tuple(map(float, pixel.split(","))) for pixel in (first, second)]
        (_, _), (_, _) = pixels
        return Scale.known_length(photo, *pixels, float(metres))
    except ValueError as error:
        raise SettingsError(
            f"'{known_length}' is not PHOTO:X,Y:X,Y:METRES", where="--known-length",
            cure="For example --known-length IMG_01:120,400:520,410:1.8",
        ) from error  # fmt: skip


def _number(text: str, option: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise SettingsError(
            f"'{text}' is no number of metres", where=option, cure="For example 1.5."
        ) from error


def _direction(text: str) -> tuple[float, ...]:
    try:
        x, y, z = map(float, text.split(","))
    except ValueError as error:
        raise SettingsError(
            f"'{text}' is not X,Y,Z", where="--up", cure="For example --up 0.02,-0.01,1."
        ) from error
    return x, y, z


def _overrides(pairs: tuple[str, ...], form: str = "--set key=value") -> dict[str, str]:
    overrides = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals:
            raise SettingsError(f"'{pair}' has no '='", where=form.split()[0], cure=f"Write {form}.")
        overrides[key.strip()] = value.strip()
    return overrides


def _cancel_at_once() -> None:
    """Let SIGINT and SIGTERM end the process within moments, native calls under way included.

    Python's own handlers wait for the main thread to leave a compiled kernel; a thread
    that reads the wake-up pipe does not. Nothing published is half-written at any time.
    """
    if threading.current_thread() is not threading.main_thread():
        return
    from .workers.child import kill_children

    reader, writer = socket.socketpair()
    writer.setblocking(False)
    signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: None)

    def wait() -> None:
        number = reader.recv(1)[0]
        kill_children()
        print("\nr2sego: cancelled; finished steps are kept", file=sys.stderr, flush=True)
        os._exit(128 + number)

    wait.writer = writer  # keeps the socket open as long as the thread lives
    threading.Thread(target=wait, name="cancel", daemon=True).start()
