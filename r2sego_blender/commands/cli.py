"""The one command tree: ``r2sego …`` and ``python -m r2sego_blender …``.

Every door of the project (a shell, a button in Blender, a script, CI) comes in here.
Heavy libraries are imported inside the commands, so that ``--help`` and ``status`` answer
at once.
"""

from __future__ import annotations

import io
import os
import sys
from typing import Any

import click

from .. import __version__
from ..core.errors import MachineError, R2SEgoError, of_file
from ..core.progress import JsonProgress
from ..core.resources import available_cores, require_addresses
from ..workers.cancelling import cancel_at_once
from ..workers.engine import GOING_ON
from . import (
    asset,
    backends,
    bench,
    captures,
    demo,
    experiments,
    policy,
    proxy,
    reproduce,
    results,
    robot,
    scene,
    splats,
    trials,
    views,
)
from .options import Commands


class _Commands(Commands):
    """A group whose commands turn this project's errors into one line and exit code 1."""

    def invoke(self, context: click.Context) -> Any:
        try:
            try:
                return super().invoke(context)
            except BrokenPipeError:  # nobody reads any more
                raise
            except OSError as error:
                raise of_file(error) from error
            except MemoryError as error:
                raise MachineError(
                    "there is not enough memory", cure="Close other programs, or use smaller settings."
                ) from error
            except ImportError as error:
                raise MachineError(
                    f"a package cannot be loaded: {error}", cure="`r2sego doctor` says which are missing."
                ) from error
        except R2SEgoError as error:
            if context.obj and context.obj.get("json"):
                JsonProgress().emit_error(error)
            click.echo(f"r2sego: {error}", err=True)
            context.exit(1)


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="r2sego")
@click.pass_context
def main(context: click.Context) -> None:
    """A handful of photographs becomes a scene a robot can be trained in.

    \b
    r2sego new room.r2s --captures photographs/
    r2sego refine room.r2s --preset preview
    r2sego status room.r2s
    r2sego export room.r2s --to room/

    `r2sego demo demo.r2s` does it with photographs that come along, and `r2sego COMMAND --help` says
    more of each. Lengths are metres, z is up; SCENE is the bundle, a folder such as room.r2s.
    """
    context.obj = {}
    require_addresses()
    # As in a file, on Windows.
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors in ("strict", "surrogateescape"):
        sys.stdout.reconfigure(errors="backslashreplace")  # a name that it cannot write ends no command
    if "numba" not in sys.modules:  # Numba knows no containers; once it is there it would forget its cache
        os.environ.setdefault("NUMBA_NUM_THREADS", str(available_cores()))
    cancel_at_once("finished steps are kept" if context.invoked_subcommand in GOING_ON else "")


_ABOUT = (
    scene,
    demo,
    captures,
    proxy,
    robot,
    views,
    asset,
    results,
    experiments,
    splats,
    policy,
    reproduce,
    trials,
    bench,
    backends,
)
for about in _ABOUT:
    for command in about.COMMANDS:
        main.add_command(command)
