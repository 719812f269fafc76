"""The embedded wheeled base: a round platform with two driven wheels and a camera on a mast, as MJCF.

Its shapes, sizes and masses are this project's own, those of a common indoor base: 42 cm
across, about 23 kg, a camera 1.2 m above the floor. It is driven differentially; two casters
without friction carry it before and behind, so it turns on the spot.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree

WHEEL_RADIUS_M = 0.09
TRACK_M = 0.34
"""Between the wheels' middles."""

CAMERA_HEIGHT_M = 1.2
"""Of the mast camera above the floor."""

CAMERA_PITCH_DOWN_RAD = 0.35
CAMERA_HFOV_DEG = 69.0

_RESOLUTION_PX = (640, 480)
_BODY_RADIUS_M, _BODY_HALF_HEIGHT_M, _BODY_Z_M = 0.21, 0.08, 0.07
_MAST_RADIUS_M, _MAST_X_M = 0.025, -0.05
_CASTER_RADIUS_M, _CASTER_X_M = 0.04, 0.15
_WHEEL_HALF_WIDTH_M = 0.02
# Base plate with batteries and motors, each wheel, mast, and the camera's head on top.
_BODY_KG, _WHEEL_KG, _MAST_KG, _HEAD_KG = 18.0, 1.2, 1.8, 0.6
_CASTER_KG = 0.3
_WHEEL_DAMPING, _WHEEL_ARMATURE_KG_M2 = 0.02, 0.01
# The wheels' servos: stiff enough to roll through the helping wrench's lag, within 15 N m.
_WHEEL_STIFFNESS, _WHEEL_SERVO_DAMPING, _WHEEL_EFFORT_NM = 40.0, 4.0, 15.0


def wheeled_base_mjcf() -> str:
    """The embedded wheeled base as MJCF text; compiles alone, without any other file.

    The body ``base`` has its origin between the wheels, on their axle; ``mast_camera`` looks
    ahead and 20 degrees down; the keyframe ``stand`` has the wheels on z = 0.
    """
    root = ElementTree.Element("mujoco", model="wheeled_base")
    ElementTree.SubElement(root, "compiler", angle="radian")
    defaults = ElementTree.SubElement(root, "default")
    ElementTree.SubElement(defaults, "geom", contype="1", conaffinity="0", rgba="0.75 0.77 0.8 1")
    world = ElementTree.SubElement(root, "worldbody")
    base = ElementTree.SubElement(world, "body", name="base", pos=f"0 0 {WHEEL_RADIUS_M}")
    ElementTree.SubElement(base, "freejoint", name="floating_base_joint")
    _add_geom(base, "body", "cylinder", (_BODY_RADIUS_M, _BODY_HALF_HEIGHT_M), (0.0, 0.0, _BODY_Z_M), _BODY_KG)
    top_m = CAMERA_HEIGHT_M - WHEEL_RADIUS_M
    middle_m = (_BODY_Z_M + _BODY_HALF_HEIGHT_M + top_m) / 2.0
    half_m = middle_m - _BODY_Z_M - _BODY_HALF_HEIGHT_M
    _add_geom(base, "mast", "cylinder", (_MAST_RADIUS_M, half_m), (_MAST_X_M, 0.0, middle_m), _MAST_KG)
    _add_geom(base, "head", "box", (0.03, 0.06, 0.03), (_MAST_X_M, 0.0, top_m), _HEAD_KG)
    for end, x in (("front", _CASTER_X_M), ("rear", -_CASTER_X_M)):
        place = (x, 0.0, _CASTER_RADIUS_M - WHEEL_RADIUS_M)
        caster = _add_geom(base, f"{end}_caster", "sphere", (_CASTER_RADIUS_M,), place, _CASTER_KG)
        # The contact's friction is the greater of the two surfaces', unless one has priority.
        caster.attrib |= {"friction": "0.01 0.001 0.0001", "priority": "1"}
    actuators = ElementTree.Element("actuator")
    for side, y in (("left", TRACK_M / 2.0), ("right", -TRACK_M / 2.0)):
        _add_wheel(base, actuators, side, y)
    _add_camera(base, top_m)
    root.append(actuators)
    keys = ElementTree.SubElement(root, "keyframe")
    ElementTree.SubElement(keys, "key", name="stand", qpos=f"0 0 {WHEEL_RADIUS_M} 1 0 0 0 0 0")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _add_geom(
    body: ElementTree.Element,
    name: str,
    kind: str,
    size: tuple[float, ...],
    place: tuple[float, float, float],
    mass_kg: float,
) -> ElementTree.Element:
    return ElementTree.SubElement(
        body, "geom", name=name, type=kind, size=_text(size), pos=_text(place), mass=f"{mass_kg}"
    )


def _add_wheel(base: ElementTree.Element, actuators: ElementTree.Element, side: str, y: float) -> None:
    """A wheel on the axle; a growing angle rolls it ahead."""
    wheel = ElementTree.SubElement(base, "body", name=f"{side}_wheel", pos=f"0 {y} 0")
    name = f"{side}_wheel_joint"
    ElementTree.SubElement(
        wheel,
        "joint",
        name=name,
        axis="0 1 0",
        limited="false",
        damping=f"{_WHEEL_DAMPING}",
        armature=f"{_WHEEL_ARMATURE_KG_M2}",
    )
    size_m = (WHEEL_RADIUS_M, _WHEEL_HALF_WIDTH_M)
    tyre = _add_geom(wheel, f"{side}_tyre", "cylinder", size_m, (0.0, 0.0, 0.0), _WHEEL_KG)
    tyre.set("zaxis", "0 1 0")
    ElementTree.SubElement(
        actuators,
        "position",
        name=name,
        joint=name,
        kp=f"{_WHEEL_STIFFNESS}",
        kv=f"{_WHEEL_SERVO_DAMPING}",
        forcerange=f"{-_WHEEL_EFFORT_NM} {_WHEEL_EFFORT_NM}",
    )


def _add_camera(base: ElementTree.Element, top_m: float) -> None:
    width, height = _RESOLUTION_PX
    fovy_rad = 2.0 * math.atan(math.tan(math.radians(CAMERA_HFOV_DEG) / 2.0) * height / width)
    # A MuJoCo camera looks along -z with y up: x is the body's -y, y is forward-and-up.
    ElementTree.SubElement(
        base,
        "camera",
        name="mast_camera",
        pos=_text((_MAST_X_M + 0.03, 0.0, top_m)),
        xyaxes=f"0 -1 0 {math.sin(CAMERA_PITCH_DOWN_RAD)!r} 0 {math.cos(CAMERA_PITCH_DOWN_RAD)!r}",
        fovy=f"{math.degrees(fovy_rad)!r}",
        resolution=f"{width} {height}",
    )


def _text(values: tuple[float, ...]) -> str:
    return " ".join(f"{value!r}" for value in values)
