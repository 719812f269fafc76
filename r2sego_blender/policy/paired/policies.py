"""One policy of a paired experiment, in a process of its own: trained, and tested on episodes."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

from ...core.json_files import write_json
from ..dagger.settings import DaggerSettings
from ..training import Task, policy_outcomes, train_policy

OUTCOMES = "outcomes.json"
STUDENT = "student"


def as_json(task: Task) -> dict[str, Any]:
    """A task, ready for JSON."""
    said: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(task), default=str))
    return said


def _task(said: dict[str, Any]) -> Task:
    return Task(**(said | {"scene": Path(said["scene"]), "chairs": tuple(said["chairs"])}))


def train_and_test(request: dict[str, Any]) -> dict[str, Any]:
    """Train in ``task`` with ``settings``, or go on with it, and write the outcomes of ``tests`` into ``place``.

    Each test has ``episodes``, which the seed of the settings draws: the two policies of a pair have the same.
    """
    place, settings = Path(request["place"]), DaggerSettings(**request["settings"])
    train_policy(_task(request["task"]), place / STUDENT, settings)
    outcomes = {}
    for name, said in request["tests"].items():
        made = policy_outcomes(_task(said), place / STUDENT, request["episodes"], settings.seed)
        outcomes[name] = [dataclasses.astuple(outcome) for outcome in made]
    write_json(place / OUTCOMES, outcomes)
    return {}
