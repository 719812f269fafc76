"""``r2sego trials``: plan, run, judge and count trials on a real robot.

A file a part of the work; each has its commands.
"""

from __future__ import annotations

import click

from ..options import Commands
from . import line, plan, run, tables


@click.group(cls=Commands)
def trials() -> None:
    """Trials on a real robot: a plan frozen beforehand, sensors that judge, raw data kept."""


for _command in (*line.COMMANDS, *plan.COMMANDS, *run.COMMANDS, *tables.COMMANDS):
    trials.add_command(_command)

COMMANDS = (trials,)
