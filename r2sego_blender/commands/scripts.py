"""What the scripts in batch/ share: arguments and errors under Blender and under plain Python."""

from __future__ import annotations

import signal
import sys
import traceback
from collections.abc import Callable

from ..core.errors import R2SEgoError

_REPORT = "Error: "


def script_arguments() -> list[str]:
    """The person's arguments: behind ``--`` when there is one, else behind the script's name."""
    given = sys.argv
    return given[given.index("--") + 1 :] if "--" in given else given[1:]


def run_script(main: Callable[[list[str]], int]) -> None:
    """Call ``main`` with the person's arguments and end the process with its exit status.

    Whatever fails ends it with status 1: after an error that leaves a script, Blender ends with 0.
    SIGTERM and SIGHUP leave what runs as Ctrl-C does, so that no job goes on alone.
    """
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda number, _: sys.exit(128 + number))
    try:
        status = main(script_arguments())
    except R2SEgoError as error:
        print(f"r2sego: {error}", file=sys.stderr)
        status = 1
    except Exception as error:
        said = str(error).strip()
        if isinstance(error, RuntimeError) and said.startswith(_REPORT):  # an operator's
            print(f"r2sego: {said.removeprefix(_REPORT)}", file=sys.stderr)
        else:
            traceback.print_exc()
        status = 1
    sys.exit(status)
