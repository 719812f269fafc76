"""What the next refinement would do again: a dry run of Algorithm 1 over the journal's digests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..bundle.runner import Plan, PlannedStep
from ..bundle.scene import Scene
from ..core.errors import R2SEgoError
from ..pipeline import refine

PARTS = {
    "geometry/depth": "stereo",
    "geometry/initial_asset.ply": "initial asset",
    "geometry/observed.npz": "observed points",
    "geometry/planes.npz": "room planes",
    "geometry/estimated": "estimated depth",
    "geometry/completed": "completed depth",
    "geometry/backdrop.ply": "backdrop",
    "geometry/priors": "priors",
    "proxy": "proxy",
    "collision": "collision",
    "rollouts": "rollouts",
    "selection": "view selection",
    "views": "generation",
    "asset.ply": "asset",
}
"""What people call the steps, in the order of the work; those of rounds by their last name."""


_HALF = "A correction was cut off; Refine finishes it first, and redoes what it moved"


def plan_refinement(scene: Scene) -> tuple[PlannedStep, ...]:
    """Every step of Algorithm 1 on ``scene`` in order, and why it would be run again.

    A step whose input is redone counts as redone; should the input come out the same, it is kept.
    """
    plan = Plan(scene)
    refine(scene, runner=plan)
    return tuple(plan.steps)


def parts_outdated(scene: Scene) -> list[str]:
    """What people call the parts that are there and that the next refinement would do again.

    None where the plan cannot be made: ``outlook`` says why.
    """
    return outlook(scene)[0]


def outlook(scene: Scene) -> tuple[list[str], str]:
    """As ``parts_outdated``, and why the next refinement would not begin, as for a robot or a photograph that is gone;
    "" where it would."""
    try:
        steps = plan_refinement(scene)
    except R2SEgoError as error:
        return [], str(error)
    there = [step for step in steps if (scene.path / step.target).exists()] if scene.recorded() else []
    return describe_plan(there)["redone"], ""


def describe_plan(steps: Sequence[PlannedStep], half_corrected: bool = False) -> dict[str, Any]:
    """The plan, JSON-ready: ``line``, the ``parts`` redone and kept, and every step.

    Of a scene that is ``half_corrected`` it says so: once that is finished, other steps may be redone.
    """
    redone, kept = ([step for step in steps if bool(step.why) is again] for again in (True, False))
    parts = {_part(step.target) for step in redone}
    words = {
        "redone": [name for key, name in PARTS.items() if key in parts],
        "kept": [name for key, name in PARTS.items() if key not in parts and key in map(_part_of, kept)],
    }
    return {
        "line": _HALF if half_corrected else _line(words, redone),
        **words,
        "steps": [{"step": step.target, "redone": bool(step.why), "why": step.why} for step in steps],
    }


def lines(described: Mapping[str, Any]) -> list[str]:
    """What ``describe_plan`` says, for a person."""
    table = [f"{step['step']:<28}{step['why'] or 'kept'}" for step in described["steps"]]
    return [*table, described["line"]]


def _line(words: Mapping[str, Sequence[str]], redone: Sequence[PlannedStep]) -> str:
    if not words["redone"]:
        return "Refine has nothing to redo"
    rounds = sorted({int(step.target.split("/")[1]) for step in redone if step.target.startswith("rounds/")})
    where = ""
    if rounds:
        where = f" (round {rounds[0]})" if len(rounds) == 1 else f" (rounds {rounds[0]} to {rounds[-1]})"
    kept = f"; keeps {', '.join(words['kept'])}" if words["kept"] else ""
    return f"Refine redoes {', '.join(words['redone'])}{where}{kept}"


def _part(target: str) -> str:
    return target if target in PARTS else target.rpartition("/")[2]


def _part_of(step: PlannedStep) -> str:
    return _part(step.target)
