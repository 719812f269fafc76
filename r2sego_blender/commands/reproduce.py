"""``r2sego reproduce``: the paper's tables and its curve, made anew on scenes of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .experiments import RunOptions, plan_options, run_plan
from .options import ANY_PATH, FOLDER, Commands, Output, names_of, output_options, overrides_of

PREPARED = {
    "table1": "Refined scenes against the methods of others, on frozen views.",
    "table2": "What each part of the method is worth.",
    "fig-captures": "How many captures a method needs.",
}
"""The prepared plans by name, and what they tell."""


@click.group(cls=Commands)
def reproduce() -> None:
    """The paper's tables and its curve, made anew on scenes of one's own."""


def _prepared(name: str, told: str) -> click.Command:
    """The command that runs the prepared plan ``name``."""

    @click.command(name, help=f"{told} The scenes are those in --data; it runs as `r2sego experiment` does.")
    @click.option("--data", required=True, type=FOLDER, help="Folder of scenes, each with a cameras.json.")
    @click.option("--scenes", default="", metavar="NAME,NAME", help="Of the scenes in the folder these alone.")
    @plan_options
    def command(data: Path, scenes: str, run: RunOptions) -> None:
        from ..experiments.prepared import prepared_plan

        run_plan(prepared_plan(name, data, names_of(scenes)), run)

    return command


for _name, _told in PREPARED.items():
    reproduce.add_command(_prepared(_name, _told))


@reproduce.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--out", "folder", required=True, type=FOLDER, help="Folder of the policies, made if missing.")
@click.option("--seeds", type=click.IntRange(1, 1000), default=5, show_default=True, help="Pairs of policies.")
@click.option("--episodes", type=click.IntRange(1, 100_000), default=25, show_default=True, help="Of each test.")
@click.option("--reference", type=ANY_PATH, help="The reference room, as docs/policy.md makes one: a test more.")
@click.option("--processes", type=click.IntRange(1, 256), default=2, show_default=True, help="Policies at a time.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="One setting, as in docs/policy.md.")
@output_options("--json-progress")
def table3(
    scene: Path,
    folder: Path,
    seeds: int,
    episodes: int,
    reference: Path | None,
    processes: int,
    overrides: tuple[str, ...],
    output: Output,
) -> None:
    """Policies trained in SCENE seen through the strongest baseline's splats and through the refined ones.

    All else is the same. Both are tested where they learnt, on separate chairs, and in the reference room. What is
    there is not made again; table3.md in the folder is the table. SCENE has been evaluated.
    """
    from ..bundle.figures import BASELINES, METRICS
    from ..bundle.scene import Scene
    from ..core.atomic_files import write_whole
    from ..core.errors import EvaluationError
    from ..evaluation.arms import ARMS, DEFAULT_ARMS, REFINED, strongest_baseline
    from ..policy.environment.chairs import CHAIRS
    from ..policy.paired.experiment import PairedExperiment, run_experiment
    from ..policy.paired.table import markdown
    from ..policy.training import Task, settings_of
    from ..results.status import scores_hold

    bundle = Scene.open(scene)
    psnr = {arm: scores["psnr"] for arm, scores in bundle.read(METRICS).get("arms", {}).items()}
    baseline = strongest_baseline(psnr, [arm for arm in BASELINES if arm in DEFAULT_ARMS])  # with an asset to see
    if not baseline or REFINED not in psnr:
        raise EvaluationError(
            "the scene's arms were not scored yet", where=scene, cure="Run `r2sego evaluate` on it first."
        )
    if not scores_hold(bundle):  # which baseline is strongest, and what both score, may be others by now
        raise EvaluationError(
            "the scene was scored before its assets changed", where=scene, cure="Run `r2sego evaluate` on it again."
        )
    arms = {arm: Task(bundle.path, str(bundle.path / ARMS[arm].asset)) for arm in (baseline, REFINED)}
    tests: dict[str, dict[str, Any]] = {"separate chairs": {"chairs": sorted(CHAIRS)}}
    if reference is not None:
        tests["reference room"] = {"reference": str(reference.resolve())}
    experiment = PairedExperiment(arms, tests, seeds, episodes, settings_of(overrides_of(overrides)))
    found = run_experiment(experiment, folder, processes, output.progress)
    table = [*markdown(found, psnr)]
    write_whole(folder / "table3.md", "\n".join(table) + "\n")
    output.show({"table": str(folder / "table3.md")}, lambda _: table)


COMMANDS = (reproduce,)
