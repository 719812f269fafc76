"""The behaviour scope B: which motions, views and initial conditions count (docs/behaviour-scope.md)."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...config.declared_files import Reader, is_place, shipped_names
from ...config.fields import Range, setting
from ...core.errors import RobotError
from ..behaviours.registry import BEHAVIOURS
from .region import problem_of

FREE_FLOOR = "free_floor"
CONTROLLERS = ("reference", "policy", "replay", "student")
LAYOUTS = Path(__file__).parents[1] / "policies"
"""The observation layouts that come with the library."""

_PRESETS = Path(__file__).parents[1] / "scopes"


def shipped_scopes() -> tuple[str, ...]:
    """Names of the scopes that come with the library."""
    return shipped_names(_PRESETS)


def shipped_layouts() -> tuple[str, ...]:
    """Names of the observation layouts that come with the library."""
    return shipped_names(LAYOUTS)


def _file(value: Any, scope: Path) -> str:
    """The whole path of a file beside the scope's, there or not; shipped names stay names."""
    if not isinstance(value, str):
        raise ValueError("Write a file's name in quotes.")
    if "\0" in value:
        raise ValueError("Write a name that a file can have.")
    beside = scope.parent / value
    is_shipped = value.startswith("embedded:") and not beside.exists()
    return value if not value or is_shipped else str(beside.resolve())


def _layout(value: Any, scope: Path) -> str:
    is_shipped = value in shipped_layouts() and not (scope.parent / value).exists()
    return value if is_shipped else _file(value, scope)


def _motions(value: Any, scope: Path) -> tuple[str, ...]:
    if not isinstance(value, list):
        raise ValueError('Write a list of files: ["walk.csv"].')
    return tuple(_file(one, scope) for one in value)


def _within(value: Any, scope: Path) -> str | tuple[tuple[float, float], ...]:
    if value == FREE_FLOOR:
        return FREE_FLOOR
    if not isinstance(value, list) or not all(map(is_place, value)):
        raise ValueError(f"Write '{FREE_FLOOR}' or [[x, y], [x, y], [x, y], ...].")
    corners = tuple((float(x), float(y)) for x, y in value)
    if problem := problem_of(corners):
        raise ValueError(f"It {problem}. Draw another polygon.")
    return corners


@dataclass(frozen=True)
class Robot:
    """The robot this scope is meant for; what is left out is the scene's own declaration."""

    model: str = setting("", "An MJCF or URDF file, beside this one, or an embedded robot's name.", read=_file)
    mount: Any = setting(  # the robot's loader knows its forms
        None, "A camera's name, [parent, xyz, rpy, fov], or a table of these; absent: the file's own."
    )


@dataclass(frozen=True)
class Control:
    """The behaviour controller; its files lie beside the scope's."""

    kind: str = setting(
        "reference",
        "Reference motions tracked, a learned policy, recorded motions replayed, or a student that sees.",
        choices=CONTROLLERS,
    )
    file: str = setting(
        "", "The policy: ONNX, or TorchScript, which can run code of its maker's. The student: ONNX.", read=_file
    )
    layout: str = setting("", "The policy's observation layout: a shipped one's name, or a TOML file.", read=_layout)
    motions: tuple[str, ...] = setting((), "The recorded motions.", read=_motions)
    tracker: str = setting(
        "",
        "TWIST2's ONNX file, which tracks motions without a helping wrench in the embedded controller's place.",
        read=_file,
        added=True,
    )


@dataclass(frozen=True)
class Region:
    """The body-relevant region of the floor."""

    within: str | tuple[tuple[float, float], ...] = setting(
        FREE_FLOOR, "The free floor, or a polygon of (x, y) in metres.", read=_within
    )
    clearance_m: float = setting(0.08, "Kept between the resting robot's reach and obstacles.", 0.0, 1.0)


Behaviours: Any = dataclasses.make_dataclass(
    "Behaviours",
    [(one.name, float, setting(one.weight, one.doc, 0.0, 1000.0, added=one.place is None)) for one in BEHAVIOURS],
    frozen=True,
    namespace={"__module__": __name__, "__doc__": "How often each behaviour is drawn, relative to the others."},
)


@dataclass(frozen=True)
class Start:
    """The distribution of initial conditions; the place is uniform in the region."""

    heading_offset_deg: Range = setting((-60.0, 60.0), "From the walk's first direction.", -180.0, 180.0)
    pelvis_height: Range = setting((0.93, 0.98), "Share of the standing height.", 0.75, 1.0)


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
class _Common:
    """What stands before the behaviours' own ranges."""

    name: str
    robot: Robot = Robot()
    controller: Control = Control()
    region: Region = Region()
    behaviours: Any = Behaviours()
    start: Start = Start()


if TYPE_CHECKING:  # which knows no behaviours: those are Any

    @dataclass(frozen=True)
    class _WithRanges(_Common):
        def __getattr__(self, name: str) -> Any: ...

else:
    _WithRanges = dataclasses.make_dataclass(
        "_WithRanges",
        [(one.name, one.parameters, setting(one.parameters(), added=one.place is None)) for one in BEHAVIOURS],
        bases=(_Common,),
        frozen=True,
    )


@dataclass(frozen=True)
class BehaviourScope(_WithRanges):
    """A declared behaviour scope; what a file leaves out has the defaults above.

    Each behaviour has a field of its name, the ranges that it is drawn from.
    """

    look: Look = Look()
    episode: Episode = Episode()
    failures: Failures = Failures()

    def robot_for(self, declared: str) -> tuple[str, Any]:
        """The robot's source and mount, as ``RobotModel.load`` takes them: its own, else the declared."""
        return self.robot.model or declared, self.robot.mount

    @property
    def files(self) -> tuple[Path, ...]:
        """The files it names that are there."""
        control = self.controller
        named = (self.robot.model, control.file, control.layout, *control.motions, control.tracker)
        return tuple(Path(name) for name in named if name and Path(name).is_file())

    @staticmethod
    def load(source: str | Path) -> BehaviourScope:
        """Read a scope from a TOML file, or a shipped one by its name.

        Raises RobotError naming the file and the field: an unknown field, a value of
        another kind or out of its range.
        """
        reader, data = Reader.of(source, _PRESETS, "behaviour scope", "docs/behaviour-scope.md", RobotError)
        return BehaviourScope.from_tables(data, reader.where)

    @staticmethod
    def from_tables(data: dict[str, Any], path: Path) -> BehaviourScope:
        """The scope of a file's tables; ``path`` is the file's. Raises RobotError as ``load`` does."""
        reader = Reader(path, "behaviour scope", RobotError)
        scope = reader.table(BehaviourScope, {"name": path.stem, **data})
        if not scope.name:
            raise reader.wrong("name", "is empty", "Give the scope a name.")
        if sum(dataclasses.astuple(scope.behaviours)) <= 0.0:
            raise reader.wrong("behaviours", "are all zero", "Give one of them a weight above 0.")
        return scope
