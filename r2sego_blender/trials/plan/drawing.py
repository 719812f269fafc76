"""Draws the plan of a declared study: orders, labels, poses and chairs, all from one seed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...config.fields import Range
from ...core.errors import TrialError
from .declaration import Declaration
from .trial_plan import FloorPose, PlannedPolicy, PlannedTrial, TrialPlan, parsed_plan, plan_bytes


def drawn_plan(declared: Declaration, file: Path) -> TrialPlan:
    """The plan of what ``file`` declares, whose policies lie beside it; the same each time.

    Raises TrialError where a policy's file is missing, another, or that of two policies.
    """
    rng = np.random.default_rng(declared.seed)
    labels = [f"policy {number + 1}" for number in rng.permutation(len(declared.policies))]
    policies = tuple(
        PlannedPolicy(
            policy.condition,
            policy.seed,
            policy.digest(file.parent),
            label if declared.blinded else f"{policy.condition}, seed {policy.seed}",
            policy.file,
            policy.simulated_successes,
            policy.simulated_episodes,
        )
        for policy, label in zip(declared.policies, labels, strict=True)
    )
    by_content: dict[str, PlannedPolicy] = {}
    for policy in policies:
        if (other := by_content.setdefault(policy.sha256, policy)) is not policy:
            what = (
                f"have one content in {other.condition}, seed {other.seed} and {policy.condition}, seed {policy.seed}"
            )
            raise TrialError(f"policies {what}", where=file, cure="Name the file that each was trained to.")
    plan = TrialPlan(
        format=1,
        name=declared.name,
        order=declared.order,
        blinded=declared.blinded,
        seed=declared.seed,
        rules=declared.rules,
        chairs=declared.chairs,
        floor=declared.floor,
        policies=policies,
        trials=tuple(_trials(declared, policies, rng)),
    )
    return parsed_plan(plan_bytes(plan), file)


def _trials(
    declared: Declaration, policies: tuple[PlannedPolicy, ...], rng: np.random.Generator
) -> Iterator[PlannedTrial]:
    """Pair after pair, in each repetition one trial of each condition with the same poses and chair."""
    of = {(policy.condition, policy.seed): policy for policy in policies}
    conditions = list(dict.fromkeys(policy.condition for policy in policies))
    index = 0
    for seed in dict.fromkeys(policy.seed for policy in policies):
        chairs = _in_turns(declared.chairs, declared.trials, rng)
        for repetition in range(declared.trials):
            chair_pose, robot_pose = _poses(declared, rng)
            turns = range(len(conditions)) if declared.order == "alternating" else rng.permutation(len(conditions))
            for turn in turns:
                policy = of[conditions[turn], seed]
                yield PlannedTrial(
                    index,
                    policy.condition,
                    policy.label,
                    seed,
                    policy.sha256,
                    repetition,
                    declared.tether,
                    robot_pose,
                    chair_pose,
                    chairs[repetition],
                )
                index += 1


def _in_turns(chairs: tuple[str, ...], count: int, rng: np.random.Generator) -> list[str]:
    """So many chairs, each as often as the others or once more, in a drawn order."""
    rounds = -(-count // len(chairs))
    turns = [chairs[which] for _ in range(rounds) for which in rng.permutation(len(chairs))]
    return turns[:count]


def _poses(declared: Declaration, rng: np.random.Generator) -> tuple[FloorPose, FloorPose]:
    """The chair's and the robot's pose in the world."""

    def drawn(bounds: Range) -> float:
        return float(rng.uniform(*bounds))

    chair, robot = declared.chair, declared.robot
    x, y, heading = drawn(chair.x_m), drawn(chair.y_m), drawn(chair.heading_deg)
    distance, bearing, facing = drawn(robot.distance_m), drawn(robot.bearing_deg), drawn(robot.facing_deg)
    away = math.radians(heading + bearing)
    return (
        FloorPose(_rounded(x), _rounded(y), _rounded(_turned(heading))),
        FloorPose(
            _rounded(x + distance * math.cos(away)),
            _rounded(y + distance * math.sin(away)),
            _rounded(_turned(heading + bearing + 180.0 + facing)),
        ),
    )


def _turned(degrees: float) -> float:
    """The same heading within -180 to 180."""
    return (degrees + 180.0) % 360.0 - 180.0


def _rounded(value: float) -> float:
    """To a tenth of a millimetre or a ten-thousandth of a degree: what is printed is what was drawn."""
    return round(value, 4) + 0.0
