"""Experiments whose cells sleep: the real scheduler, and cells that take declared times and nothing else."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from r2sego_blender.core.images import save_image
from r2sego_blender.experiments.plan import Plan, PlannedPreset, PlannedScene

PROGRAM = Path(__file__).with_name("program.py")
COMMANDS = ("new", "refine", "evaluate")

Steps = Mapping[str, Sequence[tuple[str, float]]]
"""The steps of each command, and their seconds."""

_CAPTURES = 3


@dataclass(frozen=True)
class SleepingCells:
    """A folder of cells that sleep: their plan, their program, and the commands that came to their end."""

    work: Path
    plan: Plan

    @staticmethod
    def of(work: Path, steps: Steps, scenes: int = 1, seeds: int = 1, spread: float = 0.0) -> SleepingCells:
        """Made in ``work``: each scene takes up to a share ``spread`` more or less than ``steps`` say."""
        work.mkdir(parents=True, exist_ok=True)
        for index in range(_CAPTURES + 1):
            place = work / ("held_out" if index == _CAPTURES else "room") / f"{index}.png"
            place.parent.mkdir(exist_ok=True)
            save_image(place, np.full((6, 8, 3), index / (_CAPTURES + 1), np.float32))
        declared = {"steps": {name: [list(step) for step in steps[name]] for name in COMMANDS}, "spread": spread}
        (work / "steps.json").write_text(json.dumps(declared), encoding="utf-8")
        named = [f"scene_{index:05d}" for index in range(scenes)]
        planned = tuple(PlannedScene(work / "room", work / "held_out", name=name) for name in named)
        return SleepingCells(
            work, Plan(planned, arms=("refined",), seeds=tuple(range(seeds)), presets=(PlannedPreset(name="sleeping"),))
        )

    @property
    def program(self) -> tuple[str, ...]:
        """What a cell's commands are given to."""
        return (sys.executable, "-S", str(PROGRAM), str(self.work))

    def finished(self, command: str) -> list[str]:
        """The bundles on which a command came to its end, in their order."""
        log = self.work / "commands.log"
        lines = log.read_text(encoding="utf-8").splitlines() if log.is_file() else []
        return [line.partition(" ")[2] for line in lines if line.partition(" ")[0] == command]
