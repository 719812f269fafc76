"""What the scripts in batch/ share: arguments and errors under Blender and under plain Python."""

from __future__ import annotations

import sys
from collections.abc import Callable

from ..errors import R2SEgoError


def script_arguments() -> list[str]:
    """The person's arguments: behind ``--`` when there is one, else behind the script's name."""
    given = sys.argv
    return given[given.index("--") + 1 :] if "--" in given else given[1:]


def run_script(main: Callable[[list[str]], int]) -> None:
    """Call ``main`` with the person's arguments and end the process with its exit status."""
    try:
        status = main(script_arguments())
    except R2SEgoError as error:
        print(f"r2sego: {error}", file=sys.stderr)
        status = 1
    sys.exit(status)
