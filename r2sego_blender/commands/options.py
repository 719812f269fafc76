"""Options that several commands share, and how results are told."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, wraps
from pathlib import Path
from typing import Any, TypeVar

import click

from ..core.errors import SettingsError
from ..core.printable import printable
from ..core.progress import JsonProgress, Progress, TerminalProgress

FOLDER = click.Path(file_okay=False, path_type=Path)
ANY_PATH = click.Path(path_type=Path)
NEW_FILE = click.Path(dir_okay=False, path_type=Path)
FIRST_NOT_DONE = "the first that is not done, else the last"
Result = TypeVar("Result")

_EVENTS = "Tell progress and result as JSON lines."
_LONGEST_LINE = 4000  # characters
_WHOLE = 1000  # characters; no command's first sentence has as many


class Commands(click.Group):
    """A group whose help has what each command does in full."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, self.commands[name].get_short_help_str(_WHOLE)) for name in self.list_commands(ctx)]
            )


@dataclass(frozen=True)
class Output:
    """How a command tells what it does: to a person, as one JSON object at its end, or as JSON lines."""

    as_object: bool
    as_events: bool

    @cached_property
    def progress(self) -> Progress:
        """Where it tells how far it is: on the terminal, or as JSON lines."""
        return JsonProgress() if self.as_events else TerminalProgress()

    def show(self, result: Result, lines: Callable[[Result], list[str]]) -> None:
        """A result as an event, as one JSON object, or in the ``lines`` made of it."""
        if self.as_events:
            assert isinstance(result, dict)
            self.tell(**result)
        else:
            click.echo(json.dumps(result, indent=1) if self.as_object else "\n".join(map(_line, lines(result))))

    def tell(self, **result: Any) -> None:
        """A result as an event, or as lines of names and values on standard output."""
        if self.as_events:
            JsonProgress().emit(event="result", **result)
            return
        for name, value in result.items():
            if isinstance(value, dict):  # of counts
                value = ", ".join(f"{what} ({count})" for what, count in value.items()) or "none"
            click.echo(_line(f"{name}: {value}"))


def _line(text: str) -> str:
    """What others named, as in a table of captures, moves no cursor."""
    return "\n".join(printable(line, _LONGEST_LINE) for line in text.split("\n"))


def output_options(*names: str, whole: str = "As one JSON object.") -> Callable[[Callable], Callable]:
    """The options ``--json`` (with the help ``whole``) and ``--json-progress``, as far as named.

    The command is given the ``output`` that they ask for; with ``--json-progress`` its errors are events too.
    """
    words = {"--json": ("as_object", whole), "--json-progress": ("as_events", _EVENTS)}

    def decorate(command: Callable) -> Callable:
        @wraps(command)
        def run(*arguments: Any, as_object: bool = False, as_events: bool = False, **given: Any) -> Any:
            click.get_current_context().obj["json"] = as_events
            return command(*arguments, output=Output(as_object, as_events), **given)

        for name in reversed(names):
            run = click.option(name, words[name][0], is_flag=True, help=words[name][1])(run)
        return run

    return decorate


def settings_option(command: Callable) -> Callable:
    """The option ``--set``, given as ``overrides``."""
    return click.option(
        "--set",
        "overrides",
        multiple=True,
        metavar="KEY=VALUE",
        help="One setting, as in docs/settings.md; repeatable.",
    )(command)


def round_option(default: str = "the newest") -> Callable[[Callable], Callable]:
    """The option ``--round``, given as ``round_index``."""
    return click.option(
        "--round", "round_index", type=int, metavar="L", help=f"The round, from 0; by default {default}."
    )


def scale_options(command: Callable) -> Callable:
    """The options that say how large the scene is; ``scale_of`` reads them."""
    options = (
        click.option(
            "--known-length",
            metavar="PHOTO:X,Y:X,Y:METRES",
            help="Scale: two pixels of one photograph and their distance.",
        ),
        click.option(
            "--marker-side",
            type=float,
            metavar="METRES",
            help="Scale: side of a printed ArUco 4x4_50 marker in the photographs.",
        ),
        click.option(
            "--camera-height",
            metavar="METRES|robot",
            help="Scale: height of the first photograph's camera above the floor, or of the robot's eye.",
        ),
        click.option(
            "--depth",
            type=FOLDER,
            help="Depth maps of a sensor, called as the photographs are: 16-bit PNG in mm, or EXR, NPY in metres. "
            "They tell the scale; in a new scene they are geometry, too.",
        ),
        click.option(
            "--depth-unit", type=float, metavar="METRES", help="Unit of depth maps of whole numbers.  [default: 0.001]"
        ),
    )
    for option in reversed(options):
        command = option(command)
    return command


def scale_of(
    known_length: str | None,
    marker_side: float | None,
    camera_height: str | None,
    depth: Path | None,
    depth_unit: float | None,
    robot: str,
    scope: str,
    command: str,
) -> Any:
    """The scale the options give; None without any."""
    from ..captures.frame.scale import Scale

    given = [option for option in (known_length, marker_side, camera_height, depth) if option is not None]
    if len(given) > 1:
        raise SettingsError("the scale is given twice", where=f"r2sego {command}", cure="Give one of the options.")
    if depth_unit is not None and depth is None:
        raise SettingsError(
            "a unit without depth maps", where=f"r2sego {command}, --depth-unit", cure="Give --depth FOLDER too."
        )
    if marker_side is not None:
        return Scale.marker(marker_side)
    if depth is not None:
        return Scale.depth(depth) if depth_unit is None else Scale.depth(depth, depth_unit)
    if camera_height == "robot":
        from ..refine.behaviour import DeclaredBehaviour
        from ..robot.scope.scope import BehaviourScope

        eye = DeclaredBehaviour(BehaviourScope.load(scope), robot).model
        return Scale.camera_height(eye.eye_height_m, "robot's eye")
    if camera_height is not None:
        return Scale.camera_height(_number(camera_height, "--camera-height"))
    if known_length is None:
        return None
    try:
        photo, first, second, metres = known_length.rsplit(":", 3)
        (x_a, y_a), (x_b, y_b) = (map(float, pixel.split(",")) for pixel in (first, second))
        return Scale.known_length(photo, (x_a, y_a), (x_b, y_b), float(metres))
    except ValueError as error:
        raise SettingsError(
            f"'{known_length}' is not PHOTO:X,Y:X,Y:METRES",
            where="--known-length",
            cure="For example --known-length IMG_01:120,400:520,410:1.8",
        ) from error


def _number(text: str, option: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise SettingsError(f"'{text}' is no number of metres", where=option, cure="For example 1.5.") from error


def direction_of(text: str) -> tuple[float, ...]:
    """The direction in a text X,Y,Z. Raises SettingsError."""
    try:
        x, y, z = map(float, text.split(","))
    except ValueError as error:
        raise SettingsError(f"'{text}' is not X,Y,Z", where="--up", cure="For example --up 0.02,-0.01,1.") from error
    return x, y, z


def names_of(text: str) -> tuple[str, ...]:
    """The names of a text that has them between commas."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def overrides_of(pairs: tuple[str, ...], form: str = "--set key=value") -> dict[str, str]:
    """The settings of ``KEY=VALUE`` texts, or other pairs. Raises SettingsError."""
    overrides = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals:
            raise SettingsError(f"'{pair}' has no '='", where=form.split()[0], cure=f"Write {form}.")
        overrides[key.strip()] = value.strip()
    return overrides
