"""``r2sego robot``, ``robot-bodies`` and ``try-rollouts``: the robot declared, shown and tried."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import click

from ..bundle.scene import Scene
from .options import ANY_PATH, json_progress, overrides_of, progress_of, round_option, show, tell


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--robot", "model", help="embedded:humanoid, embedded:wheeled, or an MJCF or URDF file.")
@click.option("--scope", help="Behaviour scope: walk_and_look, sit_down or a TOML file.")
@click.option(
    "--region", metavar="POLYGON|free_floor",
    help="Where the base may be: corners in metres, '0,0 2,0 2,1.5', or wherever the floor is free.",
)  # fmt: skip
@click.option(
    "--target",
    metavar="any|NAME|X,Y",
    help="What to sit on from then on: any seat, an object or a place in metres.",
)
@click.option(
    "--set", "fields", multiple=True, metavar="FIELD=VALUE",
    help="One field of the scope, as in docs/behaviour-scope.md, with a TOML value; no value: the default "
    "again. Repeatable.",
)  # fmt: skip
@click.option("--seats", is_flag=True, help="List the seats on the newest collision surface too.")
@click.option("--json", "as_object", is_flag=True, help="As one JSON object.")
@json_progress
@click.pass_context
def robot(
    context: click.Context,
    scene: Path,
    model: str | None,
    scope: str | None,
    region: str | None,
    target: str | None,
    fields: tuple[str, ...],
    seats: bool,
    as_object: bool,
    as_json: bool,
) -> None:
    """Declare SCENE's robot and behaviour scope, and say what they are.

    Without options it only says. Fields that are changed go to a scope file of the bundle's own.
    """
    from ..editing.robot_declaration import declare_robot, describe_robot, lines, sitting_on
    from ..robot.scope.region import parse_polygon
    from ..robot.scope.scope import FREE_FLOOR
    from ..robot.scope.scope_file import value_of

    progress = progress_of(context, as_json)
    opened = Scene.open(scene)
    changes = {key: value_of(value) for key, value in overrides_of(fields).items()}
    if region is not None:
        corners = FREE_FLOOR if region == FREE_FLOOR else [[*corner] for corner in parse_polygon(region)]
        changes["region.within"] = corners
    if target is not None:
        changes = sitting_on(target, scope or opened.declaration.scope) | changes
    opened = declare_robot(opened, model, scope, changes)
    show(progress, describe_robot(opened, seats), lines, as_object)


@click.command("robot-bodies")
@click.argument("scene", type=ANY_PATH)
@round_option
@json_progress
@click.pass_context
def robot_bodies(context: click.Context, scene: Path, round_index: int | None, as_json: bool) -> None:
    """Write the robot's shapes and their poses along a round's rollouts of SCENE, for Blender.

    They stand in rounds/L/bodies.
    """
    from ..results.robot_bodies import export_bodies

    progress = progress_of(context, as_json)
    opened = Scene.open(scene)
    index = max(opened.newest_round("rollouts"), 0) if round_index is None else round_index
    tell(progress, bodies=str(export_bodies(opened, index)))


@click.command("try-rollouts")
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--attempts", type=click.IntRange(1, 1000), default=6, show_default=True, help="How many are tried."
)
@json_progress
@click.pass_context
def try_rollouts(context: click.Context, scene: Path, attempts: int, as_json: bool) -> None:
    """Try the behaviour on SCENE's newest collision surface, and say what fails; no round changes.

    The attempts are kept in robot/trial, until the next trial.
    """
    from ..editing.trial_rollouts import TRIAL
    from ..editing.trial_rollouts import try_rollouts as run

    progress = progress_of(context, as_json)
    opened = Scene.open(scene)
    tried = run(opened, attempts, progress)
    failures = Counter(rollout.reason for rollout in tried if not rollout.success)
    told: dict[str, Any] = {"attempts": len(tried), "succeeded": len(tried) - failures.total()}
    tell(progress, **told, failures=dict(failures.most_common()), rollouts=str(opened.path / TRIAL))
