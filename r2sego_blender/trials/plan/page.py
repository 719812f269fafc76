"""A plan as one page to print: rules, policies, and each trial's poses on the floor plan."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import jinja2

from ...config.fields import fields_of
from .rules import Rules
from .trial_plan import FloorPose, TrialPlan

_TEMPLATE = Path(__file__).with_name("page.html.j2")
_MARGIN_M = 0.5
_MOST_GRID_LINES = 40
_ORDERS = {
    "alternating": "conditions in a fixed alternating order",
    "randomised": "conditions in a drawn order for each seed and repetition",
}
_TETHERS = {
    "gate": "A policy runs tethered until one of its tethered trials succeeded.",
    "always": "All trials run tethered.",
}
_RERUNS = {
    "at_once": "A trial whose recording is unusable is run again at once.",
    "at_end": "Trials whose recordings are unusable are run again after all others.",
}


@dataclass(frozen=True)
class _FloorPlan:
    """What every drawing shares, as SVG has it: y grows downwards."""

    view: str
    floor: str
    grid: str

    @staticmethod
    def of(plan: TrialPlan) -> _FloorPlan:
        poses = [pose for trial in plan.trials for pose in (trial.robot_pose, trial.chair_pose)]
        points = [*map(_place, poses), *plan.floor, (0.0, 0.0)]
        left, right = (bound(x for x, _ in points) for bound in (min, max))
        low, high = (bound(y for _, y in points) for bound in (min, max))
        left, low, right, high = left - _MARGIN_M, low - _MARGIN_M, right + _MARGIN_M, high + _MARGIN_M
        step = max(1, math.ceil(max(right - left, high - low) / _MOST_GRID_LINES))  # metres
        columns = range(math.ceil(left / step) * step, math.floor(right) + 1, step)
        rows = range(math.ceil(low / step) * step, math.floor(high) + 1, step)
        grid = [f"M{x} {-high:.3f}V{-low:.3f}" for x in columns] + [f"M{left:.3f} {-y}H{right:.3f}" for y in rows]
        return _FloorPlan(
            f"{left:.3f} {-high:.3f} {right - left:.3f} {high - low:.3f}",
            " ".join(f"{x:.3f},{-y:.3f}" for x, y in plan.floor),
            "".join(grid),
        )


def plan_page(plan: TrialPlan) -> str:
    """The page's HTML, which needs nothing beside it. Of a blinded plan it tells labels alone."""
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    # A blinded operator loads each policy by its label: digests in a list sorted by labels tell no condition.
    policies = sorted((policy.label, policy.sha256) for policy in plan.policies)
    rules = [
        (field.doc, f"{getattr(plan.rules, name):g}") for name, field in fields_of(Rules).items() if field.kind is float
    ]
    return environment.from_string(_TEMPLATE.read_text(encoding="utf-8")).render(
        plan=plan,
        policies=policies,
        rules=rules,
        order=_ORDERS[plan.order],
        tether=_TETHERS[plan.trials[0].tether],
        rerun=_RERUNS[plan.rules.rerun],
        drawn=_FloorPlan.of(plan),
    )


def _place(pose: FloorPose) -> tuple[float, float]:
    return pose.x_m, pose.y_m
