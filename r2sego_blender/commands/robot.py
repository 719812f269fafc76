"""``r2sego robot``, ``try-rollouts``, ``rollouts``, ``robot-bodies`` and ``trust``: declared, tried, let go, shown."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..bundle.scene import Scene
from ..core.printable import printable
from .options import ANY_PATH, FIRST_NOT_DONE, Output, output_options, overrides_of, round_option


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--robot", "model", help="embedded:humanoid, embedded:wheeled, or an MJCF or URDF file.")
@click.option("--scope", help="Behaviour scope: walk_and_look, sit_down or a TOML file.")
@click.option(
    "--region",
    metavar="POLYGON|free_floor",
    help="Where the base may be: corners in metres, '0,0 2,0 2,1.5', or wherever the floor is free.",
)
@click.option(
    "--target", metavar="any|NAME|X,Y", help="What to sit on from then on: any seat, an object or a place in metres."
)
@click.option(
    "--set",
    "fields",
    multiple=True,
    metavar="FIELD=VALUE",
    help="One field of the scope, as in docs/behaviour-scope.md, with a TOML value; no value: the default "
    "again. Repeatable.",
)
@click.option("--seats", is_flag=True, help="List the seats on the newest collision surface too.")
@output_options("--json", "--json-progress")
def robot(
    scene: Path,
    model: str | None,
    scope: str | None,
    region: str | None,
    target: str | None,
    fields: tuple[str, ...],
    seats: bool,
    output: Output,
) -> None:
    """Declare SCENE's robot and behaviour scope, and say what they are.

    Without options it only says. Fields that are changed go to a scope file of the bundle's own.
    """
    from ..editing.robot_declaration import declare_robot, describe_robot, lines, sitting_on
    from ..robot.scope.region import parse_polygon
    from ..robot.scope.scope import FREE_FLOOR
    from ..robot.scope.scope_file import value_of

    opened = Scene.open(scene)
    changes = {key: value_of(value) for key, value in overrides_of(fields).items()}
    if region is not None:
        corners = FREE_FLOOR if region == FREE_FLOOR else [[*corner] for corner in parse_polygon(region)]
        changes["region.within"] = corners
    if target is not None:
        changes = sitting_on(target, scope or opened.declaration.scope) | changes
    opened = declare_robot(opened, model, scope, changes, output.progress)
    output.show(describe_robot(opened, seats), lines)


@click.command("robot-bodies")
@click.argument("scene", type=ANY_PATH)
@round_option()
@output_options("--json-progress")
def robot_bodies(scene: Path, round_index: int | None, output: Output) -> None:
    """Write the robot's shapes and their poses along a round's rollouts of SCENE, for Blender.

    They stand in rounds/L/bodies.
    """
    from ..results.robot_bodies import export_bodies

    opened = Scene.open(scene)
    index = max(opened.newest_round("rollouts"), 0) if round_index is None else round_index
    output.tell(bodies=str(export_bodies(opened, index)))


@click.command("try-rollouts")
@click.argument("scene", type=ANY_PATH)
@click.option("--attempts", type=click.IntRange(1, 1000), default=6, show_default=True, help="How many are tried.")
@output_options("--json-progress")
def try_rollouts(scene: Path, attempts: int, output: Output) -> None:
    """Try the behaviour on SCENE's newest collision surface, and say what fails; no round changes.

    The attempts are kept in robot/trial, until the next trial.
    """
    from ..editing.trial_rollouts import TRIAL
    from ..editing.trial_rollouts import try_rollouts as run
    from ..robot.rollouts.rollout import failed_by_reason

    opened = Scene.open(scene)
    tried = run(opened, attempts, output.progress)
    failures = failed_by_reason(tried)
    counts = {reason: len(failed) for reason, failed in failures.items()}
    told: dict[str, Any] = {"attempts": len(tried), "succeeded": len(tried) - sum(counts.values()), "failures": counts}
    if failures:
        reason, failed = next(iter(failures.items()))
        told["most_frequent"] = f"{reason}, {failed[0].detail}"
    output.tell(**told, rollouts=str(opened.path / TRIAL))


@click.command()
@click.argument("scene", type=ANY_PATH)
@round_option(FIRST_NOT_DONE)
@output_options("--json", "--json-progress")
def rollouts(scene: Path, round_index: int | None, output: Output) -> None:
    """Bring SCENE to a round's rollouts, and say what became of every attempt.

    Runs the steps of refine up to there, as far as they are not done.
    """
    from ..results.rollouts_report import describe_rollouts, lines
    from ..results.rounds import advance

    opened = Scene.open(scene)  # after the imports, which take seconds: it may be corrected meanwhile
    index = advance(opened, round_index, "rollouts", output.progress)
    output.show(describe_rollouts(opened, index), lines)


@click.command()
@click.argument("policy", type=ANY_PATH, required=False)
@click.option("--list", "listed", is_flag=True, help="List what is trusted.")
@click.option("--withdraw", metavar="SHA256", help="Trust a program no more.")
@output_options("--json", "--json-progress")
def trust(policy: Path | None, listed: bool, withdraw: str | None, output: Output) -> None:
    """Trust POLICY, a TorchScript file, on this machine.

    It is a program: whoever made it decides what it does, with your rights, when a behaviour scope names it.
    Its content is trusted, under whatever name; a bundle that brings other content is refused. Where the
    system can, it runs without writing files, without reading yours and without the network; what cannot be
    taken away here is said. ONNX files are data and need no trust.
    """
    from ..config import trusted_programs
    from ..robot.controllers.policy_trust import kept_rights, program_at

    if (policy is not None) + listed + (withdraw is not None) != 1:
        raise click.UsageError("Give one of POLICY, --list and --withdraw.")
    if policy is not None:
        program = program_at(policy)
        trusted_programs.trust(program)
        told = {"trusted": [vars(program)], "kept": list(kept_rights())}
    elif withdraw is not None:
        told = {"withdrawn": [vars(trusted_programs.withdraw(withdraw.lower()))]}
    else:
        told = {"trusted": [vars(one) for one in trusted_programs.trusted_programs()]}
    output.show(told, _trust_lines)


def _trust_lines(told: dict[str, Any]) -> list[str]:
    from ..config.trusted_programs import Program

    lines = [printable(f"{what}: {Program(**one)}") for what in ("trusted", "withdrawn") for one in told.get(what, ())]
    if "kept" in told:
        lines.append("It is a program and runs with your rights where a behaviour scope names it.")
        lines += [f"This system cannot take {', '.join(told['kept'])} away from it."] if told["kept"] else []
    return lines or ["nothing is trusted"]


COMMANDS = (robot, robot_bodies, try_rollouts, rollouts, trust)
