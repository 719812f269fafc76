"""What the scripts in batch/ share: arguments and errors under Blender and under plain Python."""

from __future__ import annotations

import argparse
import signal
import sys
import traceback
from collections.abc import Callable

from ..core.errors import R2SEgoError, of_file

_REPORT = "Error: "
_WRONG_VALUE = "Converting py args to operator properties:"


def script_arguments() -> list[str]:
    """The person's arguments: behind ``--`` when there is one, else behind the script's name."""
    given = sys.argv
    return given[given.index("--") + 1 :] if "--" in given else given[1:]


def run_script(main: Callable[[list[str]], int]) -> None:
    """Call ``main`` with the person's arguments and end the process with its exit status.

    Whatever fails ends it with status 1: after an error that leaves a script, Blender ends with 0.
    Ctrl-C, SIGTERM and SIGHUP leave what runs, so that no job goes on alone. Blender without a window
    heeds the first Ctrl-C in renders alone, and cannot leave an operator by SystemExit.
    """
    interrupts: list[int] = []

    def interrupt(number: int, _: object) -> None:
        interrupts.append(number)
        raise KeyboardInterrupt

    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, interrupt)
    try:
        status = main(script_arguments())
    except (Exception, KeyboardInterrupt) as error:
        said = _said(error)
        if interrupts:  # an operator that is left so raises another error
            print("r2sego: cancelled", file=sys.stderr)
        elif said:
            print(f"r2sego: {said}", file=sys.stderr)
        else:
            traceback.print_exc()
        status = 128 + interrupts[0] if interrupts else 1
    sys.exit(status)


def assignment(text: str) -> tuple[str, str]:
    """The two sides of an option ``KEY=VALUE``, for argparse."""
    key, equals, value = text.partition("=")
    if not (key and equals):
        raise argparse.ArgumentTypeError(f"'{text}' has no = with something before it")
    return key, value


def numbers(count: int) -> Callable[[str], tuple[float, ...]]:
    """What makes ``count`` numbers of an option such as ``X,Y,Z``, for argparse."""

    def parse(text: str) -> tuple[float, ...]:
        try:
            found = tuple(float(part) for part in text.split(","))
        except ValueError:
            found = ()
        if len(found) != count:
            raise argparse.ArgumentTypeError(
                f"'{text}' is not {'a number' if count == 1 else f'{count} numbers with commas between them'}"
            )
        return found

    return parse


def _said(error: BaseException) -> str:
    """The sentence for a person about what they can mend, '' for a fault of the program."""
    said = str(error).strip()
    if isinstance(error, R2SEgoError):
        return said
    if isinstance(error, OSError):
        return str(of_file(error))
    if isinstance(error, RuntimeError) and said.startswith(_REPORT):  # an operator's
        return said.removeprefix(_REPORT)
    if isinstance(error, (TypeError, ValueError)) and said.startswith(_WRONG_VALUE):  # of an operator's property
        return said.removeprefix(_WRONG_VALUE).strip(" :")
    return ""
