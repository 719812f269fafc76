"""The behaviour scope B: which motions, views and initial conditions count (docs/behaviour-scope.md)."""

from __future__ import annotations

import dataclasses
import difflib
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import RobotError
from ..settings import setting

Range = tuple[float, float]
"""Inclusive bounds that a rollout draws from uniformly."""

FREE_FLOOR = "free_floor"
_PRESETS = Path(__file__).parent / "scopes"


@dataclass(frozen=True)
class Region:
    """The body-relevant region of the floor."""

    within: str | tuple[tuple[float, float], ...] = setting(
        FREE_FLOOR, "The free floor, or a polygon of (x, y) in metres."
    )
    clearance_m: float = setting(0.08, "Kept between the resting robot's reach and obstacles.", 0.0, 1.0)


@dataclass(frozen=True)
class Behaviours:
    """How often each behaviour is drawn, relative to the others."""

    walk_to: float = setting(0.7, "Walk to a place, looking around.", 0.0, 1000.0)
    look_around: float = setting(0.3, "Stand, turn and look around.", 0.0, 1000.0)


@dataclass(frozen=True)
class Start:
    """The distribution of initial conditions; the place is uniform in the region."""

    heading_offset_deg: Range = setting((-60.0, 60.0), "From the walk's first direction.", -180.0, 180.0)
    pelvis_height: Range = setting((0.93, 0.98), "Share of the standing height.", 0.75, 1.0)


@dataclass(frozen=True)
class WalkTo:
    """Ranges of the walk."""

    distance_m: Range = setting((0.6, 3.5), "Length of the path.", 0.1, 50.0)
    speed_m_s: Range = setting((0.35, 0.7), "Walking speed.", 0.05, 1.2)
    turn_rate_deg_s: Range = setting((50.0, 90.0), "Bound of the turning rate.", 5.0, 180.0)


@dataclass(frozen=True)
class LookAround:
    """Ranges of the looking body."""

    turn_deg: Range = setting((-160.0, 160.0), "Turn of the body on the spot.", -360.0, 360.0)


@dataclass(frozen=True)
class Look:
    """Ranges of the gaze; ``camera_pitch_deg`` absent means the mount as it is."""

    camera_pitch_deg: Range | None = setting(None, "Mount's pitch below the horizon.", -30.0, 90.0)
    waist_yaw_deg: Range = setting((-45.0, 45.0), "Waist yaw, positive to the left.", -90.0, 90.0)
    waist_pitch_deg: Range = setting((-4.0, 6.0), "Waist pitch, positive forward.", -25.0, 25.0)
    hold_s: Range = setting((0.3, 1.2), "How long a gaze is held.", 0.0, 60.0)


@dataclass(frozen=True)
class Episode:
    """Length of a rollout and rate of its camera."""

    duration_s: float = setting(8.0, "Length of a rollout.", 0.5, 600.0)
    camera_rate_hz: float = setting(5.0, "Camera frames a second.", 0.5, 50.0)


@dataclass(frozen=True)
class Failures:
    """When a rollout has failed; non-finite states always fail."""

    fall_height: float = setting(0.6, "Pelvis below this share of its standing height.", 0.0, 1.0)
    fall_tilt_deg: float = setting(45.0, "Pelvis tilted more than this.", 5.0, 180.0)
    body_contact: bool = setting(True, "The scene touched by anything but a foot on the floor.")
    leaving_region: bool = setting(True, "The pelvis outside the region.")
    goal_distance_m: float = setting(0.3, "Time-out: farther from the goal at the end.", 0.02, 10.0)
    joint_limit_deg: float = setting(3.0, "A joint beyond its limit by more than this.", 0.0, 90.0)


@dataclass(frozen=True)
class BehaviourScope:
    """A declared behaviour scope; what a file leaves out has the defaults above."""

    name: str
    region: Region = Region()
    behaviours: Behaviours = Behaviours()
    start: Start = Start()
    walk_to: WalkTo = WalkTo()
    look_around: LookAround = LookAround()
    look: Look = Look()
    episode: Episode = Episode()
    failures: Failures = Failures()

    @staticmethod
    def load(source: str | Path) -> BehaviourScope:
        """Read a scope from a TOML file, or a shipped one by its name.

        Raises RobotError naming the file and the field: an unknown field, a value of
        another kind or out of its range.
        """
        path = _PRESETS / f"{source}.toml" if str(source) in shipped_scopes() else Path(source)
        try:
            data = tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise RobotError(
                "this behaviour scope cannot be read", where=path,
                cure=f"Give a TOML file or one of: {', '.join(shipped_scopes())}.",
            ) from error  # fmt: skip
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise RobotError(
                f"this behaviour scope is no TOML: {error}", where=path, cure="See docs/behaviour-scope.md."
            ) from error
        return _Reader(path).scope(data)


def shipped_scopes() -> tuple[str, ...]:
    """Names of the scopes that come with the library."""
    return tuple(sorted(file.stem for file in _PRESETS.glob("*.toml")))


@dataclass(frozen=True)
class _Reader:
    path: Path

    def scope(self, data: dict[str, Any]) -> BehaviourScope:
        sections = {f.name: f.default for f in dataclasses.fields(BehaviourScope) if f.name != "name"}
        name = data.pop("name", self.path.stem)
        if not isinstance(name, str) or not name:
            raise self._error("name", "is not a text", "Give the scope a name.")
        self._reject_unknown(data, sections, "")
        parts = {key: self._section(type(sections[key]), key, table) for key, table in data.items()}
        scope = BehaviourScope(name=name, **parts)
        if scope.behaviours.walk_to + scope.behaviours.look_around <= 0.0:
            raise self._error("behaviours", "are all zero", "Give one of them a weight above 0.")
        return scope

    def _section(self, kind: type, section: str, table: Any) -> Any:
        if not isinstance(table, dict):
            raise self._error(section, "is not a table", f"Write [{section}] and its fields below.")
        fields = {field.name: field for field in dataclasses.fields(kind)}
        self._reject_unknown(table, fields, f"{section}.")
        return kind(**{key: self._value(fields[key], section, value) for key, value in table.items()})

    def _value(self, field: dataclasses.Field, section: str, value: Any) -> Any:
        place, low, high = f"{section}.{field.name}", field.metadata["low"], field.metadata["high"]
        if field.name == "within":
            return self._within(place, value)
        if isinstance(field.default, bool):
            if not isinstance(value, bool):
                raise self._error(place, f"is {value!r}", "Write true or false.")
            return value
        is_range = str(field.type).startswith("Range")
        numbers = value if is_range else [value]
        if not isinstance(numbers, list) or len(numbers) != (2 if is_range else 1):
            raise self._error(place, f"is {value!r}", "Write a range [low, high].")
        if not all(_is_number(number) for number in numbers):
            raise self._error(place, f"is {value!r}", "Write finite numbers.")
        if min(numbers) < low or max(numbers) > high:
            raise self._error(place, f"is {value!r}", f"Its values lie from {low:g} to {high:g}.")
        if is_range and numbers[0] > numbers[1]:
            raise self._error(place, f"is {value!r}", "Write the smaller number first.")
        return tuple(float(number) for number in numbers) if is_range else float(value)

    def _within(self, place: str, value: Any) -> Any:
        if value == FREE_FLOOR:
            return value
        is_polygon = isinstance(value, list) and len(value) >= 3
        if not is_polygon or not all(
            isinstance(point, list) and len(point) == 2 and all(map(_is_number, point)) for point in value
        ):
            raise self._error(
                place, f"is {value!r}", f"Write '{FREE_FLOOR}' or [[x, y], [x, y], [x, y], ...]."
            )
        return tuple((float(x), float(y)) for x, y in value)

    def _reject_unknown(self, table: dict[str, Any], known: Any, prefix: str) -> None:
        for key in table:
            if key not in known:
                close = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
                cure = f"Did you mean {close[0]}?" if close else f"Known: {', '.join(known)}."
                raise self._error(f"{prefix}{key}", "is not a field of a behaviour scope", cure)

    def _error(self, field: str, what: str, cure: str) -> RobotError:
        return RobotError(f"{field} {what}", where=self.path, cure=cure)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
