"""The behaviour scope B: which motions, views and initial conditions count (docs/behaviour-scope.md)."""

from __future__ import annotations

import dataclasses
import difflib
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...config.declared_files import read_declaration, shipped_names
from ...config.settings import setting
from ...core.errors import RobotError
from .region import problem_of

Range = tuple[float, float]
"""Inclusive bounds that a rollout draws from uniformly."""

FREE_FLOOR = "free_floor"
ANY_SEAT = "any"
CONTROLLERS = ("reference", "policy", "replay")
LAYOUTS = Path(__file__).parents[1] / "policies"
"""The observation layouts that come with the library."""

_PRESETS = Path(__file__).parents[1] / "scopes"


@dataclass(frozen=True)
class Robot:
    """The robot this scope is meant for; what is left out is the scene's own declaration."""

    model: str = setting("", "An MJCF or URDF file, beside this one, or an embedded robot's name.")
    mount: str | tuple | dict | None = setting(
        None, "A camera's name, [parent, xyz, rpy, fov], or a table of these; absent: the file's own."
    )


@dataclass(frozen=True)
class Control:
    """The behaviour controller; its files lie beside the scope's."""

    kind: str = setting(
        "reference",
        "Reference motions tracked, a learned policy, or recorded motions replayed.",
        choices=CONTROLLERS,
    )
    file: str = setting("", "The policy: ONNX, or TorchScript, which can run code of its maker's.")
    layout: str = setting("", "The policy's observation layout: a shipped one's name, or a TOML file.")
    motions: tuple[str, ...] = setting((), "The recorded motions.")


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
    step_around: float = setting(0.0, "Step aside, forward and back, facing one way.", 0.0, 1000.0)
    squat: float = setting(0.0, "Stand, lower the body and look down, as for reaching.", 0.0, 1000.0)
    sit_on: float = setting(0.0, "Walk to a seat, turn, sit down and look around.", 0.0, 1000.0)


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
class StepAround:
    """Ranges of the small steps."""

    step_m: Range = setting((0.15, 0.45), "Length of one displacement.", 0.05, 1.5)
    pause_s: Range = setting((0.5, 1.5), "Standing between two.", 0.0, 60.0)


@dataclass(frozen=True)
class Squat:
    """Ranges of the squat."""

    height: Range = setting((0.6, 0.85), "Lowest height, share of the standing height.", 0.4, 1.0)
    lean_deg: Range = setting((10.0, 25.0), "Lean of the waist, forward.", -25.0, 60.0)
    hold_s: Range = setting((0.5, 2.0), "How long it stays low.", 0.0, 60.0)


@dataclass(frozen=True)
class SitOn:
    """Where and how to sit."""

    target: str | tuple[float, float] = setting(
        ANY_SEAT, "Any seat, an object's name, or (x, y) in metres: the seat nearest to it."
    )
    height_m: Range = setting((0.28, 0.6), "Heights of the surfaces that are seats.", 0.1, 1.2)
    depth_m: Range = setting((0.08, 0.16), "From the seat's front edge to the pelvis.", 0.0, 0.6)
    lean_deg: Range = setting((20.0, 28.0), "Lean of the waist while sitting down.", 0.0, 60.0)
    down_s: Range = setting((1.6, 2.4), "How long sitting down takes.", 0.5, 10.0)
    hold_s: float = setting(3.0, "Seated this long at the end, or the target is missed.", 0.0, 600.0)


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
    max_turn_deg_s: float = setting(
        0.0, "Frames during which the camera turns faster are no candidates; 0: all are.", 0.0, 3600.0
    )


@dataclass(frozen=True)
class Failures:
    """When a rollout has failed; non-finite states always fail."""

    fall_height: float = setting(0.6, "Pelvis below this share of its standing height.", 0.0, 1.0)
    fall_tilt_deg: float = setting(45.0, "Pelvis tilted more than this.", 5.0, 180.0)
    body_contact: bool = setting(True, "The scene touched by anything but a foot on the floor.")
    leaving_region: bool = setting(True, "The pelvis outside the region.")
    goal_distance_m: float = setting(0.3, "Time-out: farther from the goal at the end.", 0.02, 10.0)
    joint_limit_deg: float = setting(3.0, "A hinge beyond its limit by more than this.", 0.0, 90.0)
    joint_limit_m: float = setting(0.01, "A sliding joint beyond its limit by more than this.", 0.0, 10.0)
    slide_m: float = setting(0.03, "A foot that carries weight slides farther; 0: not judged.", 0.0, 10.0)
    penetration_m: float = setting(0.01, "Sunk deeper into the scene; 0: not judged.", 0.0, 1.0)


@dataclass(frozen=True)
class BehaviourScope:
    """A declared behaviour scope; what a file leaves out has the defaults above."""

    name: str
    robot: Robot = Robot()
    controller: Control = Control()
    region: Region = Region()
    behaviours: Behaviours = Behaviours()
    start: Start = Start()
    walk_to: WalkTo = WalkTo()
    look_around: LookAround = LookAround()
    step_around: StepAround = StepAround()
    squat: Squat = Squat()
    sit_on: SitOn = SitOn()
    look: Look = Look()
    episode: Episode = Episode()
    failures: Failures = Failures()

    def robot_for(self, declared: str) -> tuple[str, Any]:
        """The robot's source and mount, as ``RobotModel.load`` takes them: its own, else the declared."""
        return self.robot.model or declared, self.robot.mount

    @property
    def files(self) -> tuple[Path, ...]:
        """The files it names that are there."""
        named = (self.robot.model, self.controller.file, self.controller.layout, *self.controller.motions)
        return tuple(Path(name) for name in named if name and Path(name).is_file())

    @staticmethod
    def load(source: str | Path) -> BehaviourScope:
        """Read a scope from a TOML file, or a shipped one by its name.

        Raises RobotError naming the file and the field: an unknown field, a value of
        another kind or out of its range.
        """
        path, data = read_declaration(source, _PRESETS, "behaviour scope", "docs/behaviour-scope.md")
        return BehaviourScope.from_tables(data, path)

    @staticmethod
    def from_tables(data: dict[str, Any], path: Path) -> BehaviourScope:
        """The scope of a file's tables; ``path`` is the file's. Raises RobotError as ``load`` does."""
        return _Reader(path).scope(data)


def shipped_scopes() -> tuple[str, ...]:
    """Names of the scopes that come with the library."""
    return shipped_names(_PRESETS)


def shipped_layouts() -> tuple[str, ...]:
    """Names of the observation layouts that come with the library."""
    return shipped_names(LAYOUTS)


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
        if sum(dataclasses.astuple(scope.behaviours)) <= 0.0:
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
        if field.name == "mount":
            return value  # the robot's loader knows its forms
        if field.name == "target":
            return self._target(place, value)
        if field.name == "motions":
            if not isinstance(value, list):
                raise self._error(place, f"is {value!r}", 'Write a list of files: ["walk.csv"].')
            return tuple(self._file(place, one) for one in value)
        if isinstance(field.default, str):
            return self._text(field, place, value)
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

    def _text(self, field: dataclasses.Field, place: str, value: Any) -> str:
        choices = field.metadata["choices"]
        if choices and value not in choices:
            raise self._error(place, f"is {value!r}", f"Give one of: {', '.join(choices)}.")
        return value if choices else self._file(place, value)

    def _file(self, place: str, value: Any) -> str:
        """The whole path of a file beside the scope's, there or not; shipped names stay names."""
        if not isinstance(value, str):
            raise self._error(place, f"is {value!r}", "Write a file's name in quotes.")
        beside = self.path.parent / value
        is_layout = place == "controller.layout" and value in shipped_layouts()
        shipped = is_layout or value.startswith("embedded:")
        return value if not value or (shipped and not beside.exists()) else str(beside.resolve())

    def _target(self, place: str, value: Any) -> str | tuple[float, float]:
        if isinstance(value, str) and value:
            return value
        if isinstance(value, list) and len(value) == 2 and all(map(_is_number, value)):
            return float(value[0]), float(value[1])
        raise self._error(place, f"is {value!r}", f"Write '{ANY_SEAT}', an object's name, or [x, y].")

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
        corners = tuple((float(x), float(y)) for x, y in value)
        if problem := problem_of(corners):
            raise self._error(place, problem, "Draw another polygon.")
        return corners

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
