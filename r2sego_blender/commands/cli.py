"""The one command tree: ``r2sego …`` and ``python -m r2sego_blender …``.

Every door of the project (a shell, a button in Blender, a script, CI) comes in here.
Heavy libraries are imported inside the commands, so that ``--help`` and ``status`` answer
at once.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import click

from .. import __version__
from ..bundle.reading import read_beside_jobs
from ..bundle.scene import Scene
from ..config.presets import PRESETS, with_overrides
from ..core.errors import MachineError, R2SEgoError, SettingsError, of_file
from ..core.progress import JsonProgress, Progress
from ..core.resources import available_cores, require_addresses
from ..workers.cancelling import cancel_at_once
from ..workers.engine import GOING_ON
from .asset import edit_asset, render
from .bench import bench
from .captures import register
from .demo import demo
from .options import (
    ANY_PATH,
    FOLDER,
    Commands,
    json_progress,
    overrides_of,
    progress_of,
    scale_of,
    scale_options,
    settings_option,
    show,
    tell,
)
from .proxy import PROXY_COMMANDS
from .results import RESULT_COMMANDS
from .robot import robot, robot_bodies, try_rollouts
from .splats import convert, train
from .views import views


class _Commands(Commands):
    """A group whose commands turn this project's errors into one line and exit code 1."""

    def invoke(self, context: click.Context) -> Any:
        try:
            try:
                return super().invoke(context)
            except BrokenPipeError:  # nobody reads any more
                raise
            except OSError as error:
                raise of_file(error) from error
            except MemoryError as error:
                raise MachineError(
                    "there is not enough memory", cure="Close other programs, or use smaller settings."
                ) from error
            except ImportError as error:
                raise MachineError(
                    f"a package cannot be loaded: {error}", cure="`r2sego doctor` says which are missing."
                ) from error
        except R2SEgoError as error:
            if context.obj and context.obj.get("json"):
                JsonProgress().emit_error(error)
            click.echo(f"r2sego: {error}", err=True)
            context.exit(1)


@click.group(
    cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(__version__, prog_name="r2sego")
@click.pass_context
def main(context: click.Context) -> None:
    """A handful of photographs becomes a scene a robot can be trained in.

    \b
    r2sego new room.r2s --captures photographs/
    r2sego refine room.r2s --preset preview
    r2sego status room.r2s
    r2sego export room.r2s --to room/

    `r2sego demo demo.r2s` does it with photographs that come along, and `r2sego COMMAND --help` says
    more of each. Lengths are metres, z is up; SCENE is the bundle, a folder such as room.r2s.
    """
    context.obj = {}
    require_addresses()
    if getattr(sys.stdout, "errors", "") in ("strict", "surrogateescape"):  # as in a file, on Windows
        sys.stdout.reconfigure(errors="backslashreplace")  # a name that it cannot write ends no command
    if "numba" not in sys.modules:  # Numba knows no containers; once it is there it would forget its cache
        os.environ.setdefault("NUMBA_NUM_THREADS", str(available_cores()))
    cancel_at_once("finished steps are kept" if context.invoked_subcommand in GOING_ON else "")


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
    "--scope",
    default="walk_and_look",
    show_default=True,
    help="Behaviour scope: walk_and_look, sit_down or a TOML file.",
)
@scale_options
@settings_option
@json_progress
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
    """Make the bundle SCENE from photographs.

    SCENE is a new folder, by custom of a name in .r2s. Without an option for the scale, poses in metres
    count as they are, and otherwise the cameras are taken to be 1.5 m above the floor. Pixels are those
    of the upright photograph at its full size.
    """
    from ..captures.frame.scale import Scale
    from ..refine.creation import create_scene

    progress = progress_of(context, as_json)
    scale = scale_of(**given, robot=robot, scope=scope, command="new") or Scale.automatic()
    changes = overrides_of(overrides)
    settings = with_overrides(changes).captures
    made = create_scene(scene, captures, poses, robot, scope, scale, settings, progress)
    made = made.declare(overrides=changes) if changes else made
    tell(progress, scene=str(made.path), ground=made.declaration.ground, scale=made.declaration.scale_source)


@main.command()
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--preset",
    type=click.Choice(list(PRESETS)),
    help="Named settings: 'preview' for a quick look; by default the scene's, at first 'paper'.",
)
@settings_option
@click.option(
    "--rounds", type=int,
    help="Refinement rounds: 3 in 'paper', 2 in 'preview'. Short for --set rounds=L.",
)  # fmt: skip
@json_progress
@click.pass_context
def refine(
    context: click.Context,
    scene: Path,
    preset: str | None,
    overrides: tuple[str, ...],
    rounds: int | None,
    as_json: bool,
) -> None:
    """Run Algorithm 1 on SCENE; started again, it goes on where it stopped.

    Writes asset.ply, collision/ and report/index.html in SCENE. Preset and settings that are given stay
    declared for the next time.
    """
    progress = progress_of(context, as_json)
    opened = Scene.open(scene)
    changes = overrides_of(overrides) | ({} if rounds is None else {"rounds": rounds})
    if made_with := [key for key in changes if key.startswith("captures.")]:
        progress.message(f"{', '.join(made_with)}: counts for `r2sego new`; the captures stay", "warning")
    with opened.locked():
        asked = opened.declaration.with_settings(preset, changes)
        opened = opened.declare(preset=asked.preset, overrides=asked.overrides)
        from ..evaluation.scene_report import renew_scene_report
        from ..pipeline import refine as run

        before = opened.journal()
        run(opened, progress)
        report = renew_scene_report(opened, before)
    tell(progress, asset=str(opened.asset_file), collision=str(opened.collision_folder), report=str(report))


@main.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--json", "as_json", is_flag=True, help="As one JSON object.")
def status(scene: Path, as_json: bool) -> None:
    """Say what SCENE holds and how far it has come."""
    from ..results.plan import parts_outdated
    from ..results.status import describe, lines

    def state_of(opened: Scene) -> dict[str, Any]:
        return describe(opened, look_at_results=True, outdated=parts_outdated(opened))

    state = read_beside_jobs(scene, state_of)
    click.echo(json.dumps(state, indent=1) if as_json else "\n".join(lines(state)))


_round_option = click.option(
    "--round", "round_index", type=int, metavar="L",
    help="The round, from 0; by default the first that is not done, else the last.",
)  # fmt: skip


@main.command()
@click.argument("scene", type=ANY_PATH)
@_round_option
@click.option("--json", "as_object", is_flag=True, help="As one JSON object.")
@json_progress
@click.pass_context
def rollouts(
    context: click.Context, scene: Path, round_index: int | None, as_object: bool, as_json: bool
) -> None:
    """Bring SCENE to a round's rollouts, and say what became of every attempt.

    Runs the steps of refine up to there, as far as they are not done.
    """
    from ..results.rollouts_report import describe_rollouts, lines

    progress = progress_of(context, as_json)
    opened, index = _advance(scene, round_index, "rollouts", progress)
    show(progress, describe_rollouts(opened, index), lines, as_object)


@main.command()
@click.argument("scene", type=ANY_PATH)
@_round_option
@click.option("--explain", is_flag=True, help="Every candidate with its scores, and why it is no target.")
@click.option("--json", "as_object", is_flag=True, help="As one JSON object.")
@json_progress
@click.pass_context
def select(
    context: click.Context,
    scene: Path,
    round_index: int | None,
    explain: bool,
    as_object: bool,
    as_json: bool,
) -> None:
    """Bring SCENE to a round's target views, and say what they are and why.

    Runs the steps of refine up to there, as far as they are not done.
    """
    from ..results.selection_report import describe_selection, lines

    progress = progress_of(context, as_json)
    opened, index = _advance(scene, round_index, "selection", progress)
    show(progress, describe_selection(opened, index, explain), lines, as_object)


@main.command()
@click.option("--json", "as_json", is_flag=True, help="As one JSON object.")
def doctor(as_json: bool) -> None:
    """Say what is installed, what is missing, what it is for and what it costs.

    Ends with status 1 where something is missing that is required.
    """
    from ..results.doctor import examine, lines

    findings = examine()
    click.echo(json.dumps(findings, indent=1) if as_json else "\n".join(lines(findings)))
    sys.exit(0 if findings["ready"] else 1)


main.add_command(bench)
main.add_command(demo)
main.add_command(render)
main.add_command(edit_asset)
main.add_command(robot)
main.add_command(robot_bodies)
main.add_command(try_rollouts)
main.add_command(register)
main.add_command(views)
main.add_command(train)
main.add_command(convert)
for command in (*PROXY_COMMANDS, *RESULT_COMMANDS):
    main.add_command(command)


def _advance(scene: Path, round_index: int | None, name: str, progress: Progress) -> tuple[Scene, int]:
    """The scene brought as far as ``name`` of the round, and the round."""
    from ..bundle.layout import of_round
    from ..pipeline import refine as run

    opened = Scene.open(scene)  # after the imports, which take seconds: it may be corrected meanwhile
    rounds = opened.declaration.settings.rounds
    index = min(opened.rounds_done(), rounds - 1) if round_index is None else round_index
    if not 0 <= index < rounds:
        raise SettingsError(
            f"there is no round {index}", where="--round",
            cure=f"Give 0 to {rounds - 1}; the scene declares {rounds} rounds.",
        )  # fmt: skip
    with opened.locked():
        run(opened, progress, until=of_round(index, name))
    return opened, index
