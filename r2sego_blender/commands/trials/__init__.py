"""``r2sego trials``: plan, run, judge and count trials on a real robot.

A file a part of the work; each has its commands.
"""

from __future__ import annotations

import click

from ..options import Commands
from . import run


@click.group(cls=Commands)
def trials() -> None:
    """Trials on a real robot: a plan frozen beforehand, sensors that judge, raw data kept."""


for command in run.COMMANDS:
    trials.add_command(command)

COMMANDS = (trials,)
