"""A plan of small pictures, and cells that a stand-in for the program does."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from r2sego_blender.core.images import save_image

FAKE = Path(__file__).with_name("experiment_program.py")
PROGRAM = (sys.executable, "-S", str(FAKE))
PLAN = """
counts = [3, 5]
seeds = [0, 1]
arms = ["vanilla_3dgs", "same_points", "refined"]

[[scenes]]
captures = "room"
frozen = "held_out"
"""


def pictures(folder: Path, count: int, first: int) -> None:
    """Pictures of which no two are the same."""
    folder.mkdir(exist_ok=True)
    for index in range(count):
        save_image(folder / f"{first + index:02d}.png", np.full((6, 8, 3), (first + index) / 40.0, np.float32))


def finished(control: Path, command: str) -> list[str]:
    """The bundles on which a command came to its end, in order."""
    log = control / "commands.log"
    lines = log.read_text().splitlines() if log.is_file() else []
    return [line.split(" ", 2)[2] for line in lines if line.split(" ")[0] == command]
