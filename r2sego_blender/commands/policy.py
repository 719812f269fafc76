"""``r2sego policy``: a policy trained in a refined scene, evaluated, and written for other programs."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import click

from ..workers.cancelling import cancel_at_once
from .options import ANY_PATH, FOLDER, Commands, Output, names_of, output_options, overrides_of


def _task_options(command: Callable) -> Callable:
    for option in (
        click.option("--asset", default="", metavar="PLY", help="Splats in place of the scene's own."),
        click.option("--chairs", default="", metavar="NAME,NAME", help="Separate chairs in place of the room's seats."),
        click.option("--tracker", default="", metavar="ONNX", help="TWIST2's file: balance without help."),
    ):
        command = option(command)
    return command


@click.group(cls=Commands)
def policy() -> None:
    """Policies: a robot that learns to sit down from what its head sees in a refined scene."""


@policy.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--to", "folder", required=True, type=FOLDER, help="Folder of the training, made if missing.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="One setting, as in docs/policy.md.")
@_task_options
@output_options("--json-progress")
def train(
    scene: Path, folder: Path, overrides: tuple[str, ...], asset: str, chairs: str, tracker: str, output: Output
) -> None:
    """Train a student in SCENE by DAgger, or go on with the training in the folder.

    A teacher that knows the true state labels what the student sees and does. The folder holds checkpoint,
    episodes, logs for TensorBoard, and in the end student.onnx.
    """
    from ..policy.training import Task, settings_of, train_policy

    task = Task(scene, asset, names_of(chairs), tracker=tracker)
    file = train_policy(task, folder, settings_of(overrides_of(overrides)), output.progress)
    output.show({"student": str(file)}, lambda told: [told["student"]])


@policy.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--policy", "which", required=True, metavar="FOLDER|teacher", help="A training's folder, or the teacher.")
@click.option("--episodes", type=click.IntRange(1, 100_000), default=100, show_default=True)
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=0, show_default=True, help="Of the episodes.")
@click.option("--reference", default="", metavar="FOLDER", help="A reference room to take the episodes to.")
@click.option("--record", type=FOLDER, help="Keep its episodes there; in SCENE/robot/policy Blender shows them.")
@_task_options
@output_options("--json", "--json-progress")
def evaluate(
    scene: Path,
    which: str,
    episodes: int,
    seed: int,
    reference: str,
    record: Path | None,
    asset: str,
    chairs: str,
    tracker: str,
    output: Output,
) -> None:
    """How often a policy sits down in SCENE, why it failed, and how much the helping force helped."""
    from ..policy.training import Task, evaluate_policy, lines

    cancel_at_once()  # training alone keeps finished steps
    task = Task(scene, asset, names_of(chairs), reference, tracker)
    if record is None:
        found = evaluate_policy(task, which, episodes, seed, output.progress)
    else:
        from ..policy.recorded_evaluation import recorded_evaluation

        found = recorded_evaluation(task, which, episodes, seed, record, output.progress)
    output.show(dataclasses.asdict(found), lambda _: [*lines(task, which, found)])


@policy.command()
@click.argument("folder", type=FOLDER)
@click.option("--to", required=True, type=FOLDER, help="Folder to write into.")
@output_options("--json-progress")
def export(folder: Path, to: Path, output: Output) -> None:
    """Write the student of a training FOLDER as student.onnx, and what the teacher showed it as a LeRobot dataset."""
    from ..policy.exporting import DEMONSTRATIONS, export_training

    file = export_training(folder, to)
    told = {"student": str(file), "demonstrations": str(to / DEMONSTRATIONS)}
    output.show(told, lambda said: [f"{name}: {where}" for name, where in said.items()])


COMMANDS = (policy,)
