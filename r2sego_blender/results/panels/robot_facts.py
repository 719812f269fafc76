"""What Blender knows of the declared robot and its behaviour scope. No bpy.

The scope is read from its file; what takes the robot's model to know was written by the
engine (``r2sego robot``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ...bundle.figures import ROBOT_FACTS
from ...config.declared_files import Reader, is_place
from ...config.fields import setting
from ...core.errors import SceneError
from ...robot.scope.region import Polygon, area_m2
from ...robot.scope.scope import BehaviourScope
from .bundle import Bundle


@dataclass(frozen=True)
class Seat:
    """A surface to sit on: ``place_m`` (x, y) before it, ``object_name`` or ''."""

    object_name: str
    place_m: tuple[float, float]
    height_m: float
    places: int


@dataclass(frozen=True)
class _ToldCamera:
    height_m: float
    pitch_deg: float
    fov_deg: float
    fov_is_vertical: bool
    left_deg: float = 0.0
    rolled_deg: float = 0.0
    parent: str = ""


@dataclass(frozen=True)
class _ToldSeat:
    object: str
    height_m: float
    places: int
    place_m: tuple[float, ...] = setting(read=lambda place, _: _on_the_floor(place))


@dataclass(frozen=True)
class _Told:
    """What of the engine's words is shown, with its kinds: they may be of another program."""

    declared: tuple[str, str]
    joints: int
    legs: int
    wheels: int
    height_m: float
    mass_kg: float
    camera: _ToldCamera
    seats: tuple[_ToldSeat, ...] = ()
    cameras: tuple[str, ...] = ()


@dataclass(frozen=True)
class RobotFacts:
    """The scope, and what the engine said of the robot: empty where it has not, or of another one."""

    scope: BehaviourScope
    told: Mapping[str, Any]

    @staticmethod
    def read(bundle: Bundle) -> RobotFacts:
        """Read both. Raises RobotError where the declared scope cannot be read."""
        declared = bundle.scene.declaration
        scope = BehaviourScope.load(declared.scope)
        try:
            told = bundle.read(ROBOT_FACTS)
            Reader(bundle.path / ROBOT_FACTS.name, "robot", SceneError, strict=False).table(_Told, told)
            is_of_this = told["declared"] == [declared.robot, bundle.scene.name_of(declared.scope)]
        except SceneError:
            is_of_this = False
        return RobotFacts(scope, told if is_of_this else {})

    @property
    def region(self) -> Polygon:
        """The region's corners; none where it is all of the free floor."""
        within = self.scope.region.within
        return () if isinstance(within, str) else within

    @property
    def seats(self) -> tuple[Seat, ...]:
        """The seats that the engine found, if it was asked."""
        return tuple(
            Seat(one["object"], tuple(one["place_m"]), one["height_m"], one["places"])
            for one in self.told.get("seats", ())
        )

    def lines(self) -> Iterator[tuple[str, str]]:
        """Labels and values for a panel."""
        if told := self.told:
            moves = f"{told['legs']} legs" if told["legs"] else f"{told['wheels']} wheels"
            size = f"{told['height_m']:.2f} m, {told['mass_kg']:.0f} kg"
            yield "Body", f"{told['joints']} joints, {moves}, {size}"
            yield "Camera", ", ".join(_camera_words(told["camera"]))
        if self.scope.look.camera_pitch_deg is not None:
            yield "Pitch", "{:g}° to {:g}° down, drawn".format(*self.scope.look.camera_pitch_deg)
        weights = vars(self.scope.behaviours)
        yield ("Behaviours", ", ".join(f"{name} {weight:g}" for name, weight in weights.items() if weight > 0.0))
        yield "Region", f"polygon, {abs(area_m2(self.region)):.2f} m²" if self.region else "the free floor"
        if self.scope.behaviours.sit_on > 0.0:
            target = self.scope.sit_on.target
            yield "Target", target if isinstance(target, str) else "({:.2f}, {:.2f})".format(*target)


def _on_the_floor(place: Any) -> tuple[float, ...]:
    if not is_place(place):
        raise ValueError("Write [x, y] in metres.")
    return tuple(place)


def _camera_words(camera: Mapping[str, Any]) -> Iterator[str]:
    """Where the head camera sits and looks; what is as usual is not said."""
    height_m, pitch_deg = camera["height_m"], camera["pitch_deg"]
    yield f"{abs(height_m):.2f} m {'high' if height_m >= 0.0 else 'under the floor'}"
    yield f"{abs(pitch_deg):.0f}° {'down' if pitch_deg >= 0.0 else 'up'}"
    for key, ahead, behind in (("left_deg", "left", "right"), ("rolled_deg", "rolled", "rolled")):
        angle_deg = camera.get(key, 0.0)
        if abs(angle_deg) >= 0.5:
            yield f"{abs(angle_deg):.0f}° {ahead if angle_deg > 0.0 else behind}"
    yield f"{camera['fov_deg']:.0f}° {'high' if camera['fov_is_vertical'] else 'wide'}"
