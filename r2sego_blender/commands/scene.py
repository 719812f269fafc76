"""``r2sego new``, ``refine``, ``status`` and ``plan``: a scene as a whole; ``doctor``: this machine."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from ..bundle.reading import read_beside_jobs
from ..bundle.scene import Scene
from ..config.presets import PRESETS, differing, of_captures, with_overrides
from ..core.atomic_files import is_replacing
from ..workers.cancelling import cancel_at_once
from .options import ANY_PATH, Output, names_of, output_options, overrides_of, scale_of, scale_options, settings_option


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--captures",
    required=True,
    type=ANY_PATH,
    help="Folder of photographs, three at least, or a zip of it; what a phone's scanner wrote; or a video of a walk.",
)
@click.option(
    "--keyframes",
    type=int,
    metavar="N",
    help="Photographs to take of a video or of a folder that has more. Sets captures.max_keyframes, which "
    "counts without it for videos, scans and photographs without poses.",
)
@click.option(
    "--frames",
    metavar="A,B,...",
    help="Those to take in place of the chosen ones: frames of the video by their numbers, or photographs by "
    "their names.",
)
@click.option(
    "--first",
    type=click.IntRange(min=0),
    default=0,
    metavar="K",
    help="Of the photographs the first K, three at least: in the order in which their poses list them, else by name. "
    "0, the default, takes all.",
)
@click.option(
    "--poses",
    type=ANY_PATH,
    help="transforms.json, cameras.json (3DGS's too), a COLMAP folder, or what an app of phones wrote "
    "(docs/formats.md). Without it those of a phone's scan are taken, or of a folder whose photographs lie in folders "
    "below; else they are solved, and poses that lie beside the photographs are named.",
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
@click.option(
    "--refine",
    "preset",
    type=click.Choice(list(PRESETS)),
    help="Go on with `r2sego refine` of this preset once the bundle is made.",
)
@output_options("--json-progress")
def new(
    scene: Path,
    captures: Path,
    keyframes: int | None,
    frames: str | None,
    first: int,
    poses: Path | None,
    robot: str,
    scope: str,
    overrides: tuple[str, ...],
    preset: str | None,
    output: Output,
    **given: Any,
) -> None:
    """Make the bundle SCENE from photographs or a video.

    SCENE is a new folder, by custom of a name in .r2s. Without an option for the scale, poses in metres
    count as they are, and otherwise the cameras are taken to be 1.5 m above the floor. Pixels are those
    of the upright photograph at its full size.
    """
    from ..captures.frame.scale import Scale
    from ..captures.importing import Choice
    from ..refine.creation import create_scene

    scale = scale_of(**given, robot=robot, scope=scope, command="new") or Scale.automatic()
    changes = overrides_of(overrides) | ({} if keyframes is None else {"captures.max_keyframes": keyframes})
    settings = with_overrides(changes).captures
    choice = Choice(names_of(frames or ""), first, keyframes or 0)
    made = create_scene(scene, captures, poses, robot, scope, scale, settings, output.progress, choice)
    made = made.declare(overrides=changes) if changes else made
    output.tell(scene=str(made.path), ground=made.declaration.ground, scale=made.declaration.scale_source)
    if preset is not None:
        cancel_at_once("the bundle and finished steps are kept")
        refine_and_tell(made, preset, changes, output)


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--preset",
    type=click.Choice(list(PRESETS)),
    help="Named settings: 'preview' for a quick look; by default the scene's, at first 'paper'.",
)
@settings_option
@click.option("--rounds", type=int, help="Refinement rounds: 3 in 'paper', 2 in 'preview'. Short for --set rounds=L.")
@output_options("--json-progress")
def refine(scene: Path, preset: str | None, overrides: tuple[str, ...], rounds: int | None, output: Output) -> None:
    """Run Algorithm 1 on SCENE; started again, it goes on where it stopped.

    Writes asset.ply, collision/ and report/index.html in SCENE. Preset and settings that are given stay
    declared for the next time, but for those of captures: these count for `r2sego new`.
    """
    opened = Scene.open(scene)
    changes = overrides_of(overrides) | ({} if rounds is None else {"rounds": rounds})
    declared, asked = opened.declaration.settings, of_captures(changes)
    if others := differing(with_overrides(asked, declared), declared):  # not those that they were made with
        output.progress.message(f"{', '.join(others)}: counts for `r2sego new`; the captures stay", "warning")
    changes = {key: value for key, value in changes.items() if key not in asked}
    refine_and_tell(opened, preset, changes, output)


def refine_and_tell(opened: Scene, preset: str | None, changes: Mapping[str, Any], output: Output) -> None:
    """Run Algorithm 1 on a scene, and say where its results are."""
    from ..evaluation.refinement import refine_with_report

    opened, report = refine_with_report(opened, preset, changes, output.progress)
    output.tell(asset=str(opened.asset_file), collision=str(opened.collision_folder), report=str(report))


@click.command()
@click.argument("scene", type=ANY_PATH)
@output_options("--json")
def status(scene: Path, output: Output) -> None:
    """Say what SCENE holds and how far it has come."""
    from ..results.plan import outlook
    from ..results.status import describe, lines

    def state_of(opened: Scene) -> dict[str, Any]:
        return describe(opened, True, *outlook(opened))

    output.show(read_beside_jobs(scene, state_of), lines)


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--preset", type=click.Choice(list(PRESETS)), help="By default the scene's, as for refine.")
@settings_option
@output_options("--json", "--json-progress")
def plan(scene: Path, preset: str | None, overrides: tuple[str, ...], output: Output) -> None:
    """Say which steps the next refine of SCENE would run again; runs and writes nothing."""
    from ..results.plan import describe_plan, lines, plan_refinement

    changes = overrides_of(overrides)

    def planned(opened: Scene) -> dict[str, Any]:
        asked = Scene(opened.path, opened.declaration.with_settings(preset, changes))
        return describe_plan(plan_refinement(asked), is_replacing(opened.path))

    output.show(read_beside_jobs(scene, planned), lines)


@click.command()
@click.option(
    "--backends", is_flag=True, help="The learned backends instead: usable here or why not, and their licences."
)
@output_options("--json")
def doctor(backends: bool, output: Output) -> None:
    """Say what is installed, what is missing, what it is for and what it costs.

    Ends with status 1 where something is missing that is required.
    """
    if backends:
        from ..results import backends as learned

        output.show(learned.examine_backends(), learned.lines)
        return
    from ..results.doctor import examine, lines

    findings = examine()
    output.show(findings, lines)
    sys.exit(0 if findings["ready"] else 1)


COMMANDS = (new, refine, status, plan, doctor)
