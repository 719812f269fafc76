"""The embedded humanoid: a 29-joint robot of primitive shapes, written as MJCF.

Its link offsets, masses, joint names, axes, ranges, efforts and the head camera's mount are
the published ones of the Unitree G1 (29 actuated joints, RealSense D435i in the head); its
shapes are this project's own. Each link's mass is spread over its shapes by their volume.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from xml.etree import ElementTree

HEAD_CAMERA_XYZ_M = (0.0576235, 0.01753, 0.42987)
HEAD_CAMERA_RPY_RAD = (0.0, 0.8307767, 0.0)
HEAD_CAMERA_HFOV_DEG = 69.0
_HEAD_CAMERA_RESOLUTION_PX = (640, 480)

STANDING_HEIGHT_M = 0.785
"""Height of the pelvis above the floor in the ``stand`` keyframe."""

REST_POSTURE_RAD = {
    "left_shoulder_pitch_joint": 0.3,
    "right_shoulder_pitch_joint": 0.3,
    "left_shoulder_roll_joint": 0.25,
    "right_shoulder_roll_joint": -0.25,
    "left_elbow_joint": 0.97,
    "right_elbow_joint": 0.97,
    "left_wrist_roll_joint": 0.15,
    "right_wrist_roll_joint": -0.15,
}
"""Arms hanging, forearms slightly forward; joints not named are at zero."""


@dataclass(frozen=True)
class Servo:
    """A joint's position servo: stiffness and damping (N m/rad, N m s/rad)."""

    stiffness: float
    damping: float


SERVOS = {
    "hip": Servo(100.0, 2.0),
    "knee": Servo(150.0, 4.0),
    "ankle": Servo(40.0, 2.0),
    "waist": Servo(200.0, 5.0),
    "arm": Servo(40.0, 10.0),
}
"""Gains of the published velocity policy of this robot, by the joint's place in the body."""


@dataclass(frozen=True)
class _Shape:
    kind: str  # sphere, capsule or box
    size: tuple[float, ...]
    at: tuple[float, ...]  # a centre, or the two ends of a capsule

    @property
    def volume(self) -> float:
        if self.kind == "box":
            return 8.0 * math.prod(self.size)
        radius = self.size[0]
        length = math.dist(self.at[:3], self.at[3:]) if self.kind == "capsule" else 0.0
        return math.pi * radius**2 * (length + 4.0 / 3.0 * radius)

    def mirrored(self) -> _Shape:
        at = tuple(-value if index % 3 == 1 else value for index, value in enumerate(self.at))
        return replace(self, at=at)


@dataclass(frozen=True)
class _Link:
    name: str  # of the body, without its side and "_link"
    parent: str
    offset_m: tuple[float, float, float]
    mass_kg: float
    axis: str  # of its joint: x, y or z
    range_rad: tuple[float, float]
    effort_nm: float
    servo: str
    shapes: tuple[_Shape, ...]
    joint: str = ""
    tilt_rad: tuple[str, float] = ("y", 0.0)

    def on(self, side: str) -> _Link:
        """This left link on the ``left`` or the ``right`` side of the body."""
        joint, name = f"{side}_{self.joint or self.name}", f"{side}_{self.name}"
        parent = self.parent if self.parent in ("pelvis", "torso") else f"{side}_{self.parent}"
        link = replace(self, name=name, joint=joint, parent=parent)
        if side == "left":
            return link
        x, y, z = self.offset_m
        axis, angle = self.tilt_rad
        low, high = self.range_rad
        return replace(
            link,
            offset_m=(x, -y, z),
            tilt_rad=(axis, angle if axis == "y" else -angle),
            range_rad=(low, high) if self.axis == "y" else (-high, -low),
            shapes=tuple(shape.mirrored() for shape in self.shapes),
        )


def _sphere(radius: float, *at: float) -> _Shape:
    return _Shape("sphere", (radius,), at)


def _capsule(radius: float, *ends: float) -> _Shape:
    return _Shape("capsule", (radius,), ends)


def _box(half: tuple[float, float, float], *at: float) -> _Shape:
    return _Shape("box", half, at)


_PELVIS = (_box((0.058, 0.068, 0.062), 0.0, 0.0, -0.09),)
_PELVIS_MASS_KG = 3.813

# Four spheres under each foot carry the robot; the box above them meets obstacles.
_FOOT = (
    _box((0.085, 0.032, 0.011), 0.035, 0.0, -0.017),
    *(_sphere(0.01, x, y, -0.025) for x, y in ((-0.05, 0.025), (-0.05, -0.025), (0.12, 0.03), (0.12, -0.03))),
)

_LEG = (
    _Link(
        "hip_pitch",
        "pelvis",
        (0.0, 0.064452, -0.1027),
        1.35,
        "y",
        (-2.5307, 2.8798),
        88.0,
        "hip",
        (_capsule(0.04, 0.0, 0.02, -0.01, 0.0, 0.06, -0.035),),
    ),
    _Link(
        "hip_roll",
        "hip_pitch",
        (0.0, 0.052, -0.030465),
        1.52,
        "x",
        (-0.5236, 2.9671),
        88.0,
        "hip",
        (_capsule(0.045, 0.022, 0.0, -0.01, 0.025, 0.0, -0.1),),
        tilt_rad=("y", -0.1749),
    ),
    _Link(
        "hip_yaw",
        "hip_roll",
        (0.025001, 0.0, -0.12412),
        1.702,
        "z",
        (-2.7576, 2.7576),
        88.0,
        "hip",
        (_capsule(0.045, -0.01, 0.0, -0.04, -0.072, 0.0, -0.165),),
    ),
    _Link(
        "knee",
        "hip_yaw",
        (-0.078273, 0.0021489, -0.17734),
        1.932,
        "y",
        (-0.087267, 2.8798),
        139.0,
        "knee",
        (_capsule(0.04, 0.012, 0.0, -0.01, 0.004, 0.0, -0.26),),
        tilt_rad=("y", 0.1749),
    ),
    _Link(
        "ankle_pitch",
        "knee",
        (0.0, -0.000094445, -0.30001),
        0.074,
        "y",
        (-0.87267, 0.5236),
        50.0,
        "ankle",
        (_sphere(0.02, -0.005, 0.0, 0.0),),
    ),
    _Link("ankle_roll", "ankle_pitch", (0.0, 0.0, -0.017558), 0.608, "x", (-0.2618, 0.2618), 50.0, "ankle", _FOOT),
)

_TRUNK = (
    _Link(
        "waist_yaw",
        "pelvis",
        (0.0, 0.0, 0.0),
        0.244,
        "z",
        (-2.618, 2.618),
        88.0,
        "waist",
        (_sphere(0.045, 0.0, 0.0, 0.01),),
    ),
    _Link(
        "waist_roll",
        "waist_yaw",
        (-0.0039635, 0.0, 0.035),
        0.047,
        "x",
        (-0.52, 0.52),
        50.0,
        "waist",
        (_sphere(0.04, 0.0, 0.0, 0.01),),
    ),
    _Link(
        "torso",
        "waist_roll",
        (0.0, 0.0, 0.019),
        9.598,
        "y",
        (-0.52, 0.52),
        50.0,
        "waist",
        (_box((0.07, 0.095, 0.125), 0.006, 0.0, 0.165), _capsule(0.07, 0.008, 0.0, 0.34, 0.008, 0.0, 0.405)),
        joint="waist_pitch",
    ),
)

_ARM = (
    _Link(
        "shoulder_pitch",
        "torso",
        (0.0039563, 0.10022, 0.23778),
        0.718,
        "y",
        (-3.0892, 2.6704),
        25.0,
        "arm",
        (_sphere(0.036, 0.0, 0.036, -0.011),),
        tilt_rad=("x", 0.27931),
    ),
    _Link(
        "shoulder_roll",
        "shoulder_pitch",
        (0.0, 0.038, -0.013831),
        0.643,
        "x",
        (-1.5882, 2.2515),
        25.0,
        "arm",
        (_capsule(0.034, 0.0, 0.006, -0.03, 0.0, 0.007, -0.09),),
        tilt_rad=("x", -0.27925),
    ),
    _Link(
        "shoulder_yaw",
        "shoulder_roll",
        (0.0, 0.00624, -0.1032),
        0.734,
        "z",
        (-2.618, 2.618),
        25.0,
        "arm",
        (_capsule(0.034, 0.004, -0.002, -0.03, 0.012, -0.002, -0.08),),
    ),
    _Link(
        "elbow",
        "shoulder_yaw",
        (0.015783, 0.0, -0.080518),
        0.6,
        "y",
        (-1.0472, 2.0944),
        25.0,
        "arm",
        (_capsule(0.031, 0.0, 0.002, -0.008, 0.085, 0.002, -0.01),),
    ),
    _Link(
        "wrist_roll",
        "elbow",
        (0.1, 0.00188791, -0.01),
        0.085445,
        "x",
        (-1.97222, 1.97222),
        25.0,
        "arm",
        (_sphere(0.03, 0.02, 0.0, 0.0),),
    ),
    _Link(
        "wrist_pitch",
        "wrist_roll",
        (0.038, 0.0, 0.0),
        0.48405,
        "y",
        (-1.61443, 1.61443),
        5.0,
        "arm",
        (_capsule(0.029, 0.0, 0.0, 0.0, 0.046, 0.0, 0.0),),
    ),
    _Link(
        "wrist_yaw",
        "wrist_pitch",
        (0.046, 0.0, 0.0),
        0.254576,
        "z",
        (-1.61443, 1.61443),
        5.0,
        "arm",
        (_capsule(0.03, 0.03, 0.0, 0.0, 0.12, 0.003, 0.0),),
    ),
)

# Armature and damping of the joints' gearboxes, as published with the dynamics.
_ARMATURE_KG_M2 = 0.01
_JOINT_DAMPING = 0.05

_AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}


def humanoid_mjcf() -> str:
    """The embedded humanoid as MJCF text; compiles alone, without any other file.

    Bodies and joints carry the published names; ``stand`` is a keyframe with the soles on
    z = 0; ``head_camera`` is the published mount.
    """
    root = ElementTree.Element("mujoco", model="humanoid")
    ElementTree.SubElement(root, "compiler", angle="radian")
    defaults = ElementTree.SubElement(root, "default")
    ElementTree.SubElement(
        defaults, "joint", armature=f"{_ARMATURE_KG_M2}", damping=f"{_JOINT_DAMPING}", limited="true"
    )
    # Robot shapes meet the scene (conaffinity 1) but not each other.
    ElementTree.SubElement(defaults, "geom", contype="1", conaffinity="0", rgba="0.75 0.77 0.8 1")
    world = ElementTree.SubElement(root, "worldbody")
    pelvis = ElementTree.SubElement(world, "body", name="pelvis", pos=f"0 0 {STANDING_HEIGHT_M}")
    ElementTree.SubElement(pelvis, "freejoint", name="floating_base_joint")
    _add_shapes(pelvis, _PELVIS, _PELVIS_MASS_KG)
    bodies = {"pelvis": pelvis}
    links = [link.on(side) for side in ("left", "right") for link in _LEG]
    links += list(_TRUNK)
    links += [link.on(side) for side in ("left", "right") for link in _ARM]
    actuators = ElementTree.Element("actuator")
    for link in links:
        bodies[link.name] = _add_link(bodies[link.parent], link)
        gains = SERVOS[link.servo]
        ElementTree.SubElement(
            actuators,
            "position",
            name=_joint_name(link),
            joint=_joint_name(link),
            kp=f"{gains.stiffness}",
            kv=f"{gains.damping}",
            forcerange=f"{-link.effort_nm} {link.effort_nm}",
        )
    _add_camera(bodies["torso"])
    root.append(actuators)
    keys = ElementTree.SubElement(root, "keyframe")
    posture = {**REST_POSTURE_RAD, **_STANDING_LEGS_RAD}
    angles = " ".join(f"{posture.get(_joint_name(link), 0.0):.6f}" for link in links)
    ElementTree.SubElement(keys, "key", name="stand", qpos=f"0 0 {STANDING_HEIGHT_M} 1 0 0 0 {angles}")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


# Knees slightly bent, the soles flat and at z = 0 under the pelvis' standing height.
_STANDING_LEGS_RAD = {
    f"{side}_{joint}_joint": angle
    for side in ("left", "right")
    for joint, angle in (("hip_pitch", -0.146981), ("knee", 0.293963), ("ankle_pitch", -0.146981))
}


def _joint_name(link: _Link) -> str:
    return f"{link.joint or link.name}_joint"


def _add_link(parent: ElementTree.Element, link: _Link) -> ElementTree.Element:
    axis, angle = link.tilt_rad
    body = ElementTree.SubElement(
        parent, "body", name=f"{link.name}_link", pos=_text(link.offset_m), axisangle=f"{_AXES[axis]} {angle}"
    )
    ElementTree.SubElement(body, "joint", name=_joint_name(link), axis=_AXES[link.axis], range=_text(link.range_rad))
    _add_shapes(body, link.shapes, link.mass_kg)
    return body


def _add_shapes(body: ElementTree.Element, shapes: tuple[_Shape, ...], mass_kg: float) -> None:
    volume = sum(shape.volume for shape in shapes)
    for shape in shapes:
        ends = "fromto" if shape.kind == "capsule" else "pos"
        geom = ElementTree.SubElement(
            body, "geom", type=shape.kind, size=_text(shape.size), mass=f"{mass_kg * shape.volume / volume:.9f}"
        )
        geom.set(ends, _text(shape.at))


def _add_camera(torso: ElementTree.Element) -> None:
    width, height = _HEAD_CAMERA_RESOLUTION_PX
    fovy_rad = 2.0 * math.atan(math.tan(math.radians(HEAD_CAMERA_HFOV_DEG) / 2.0) * height / width)
    _, pitch, _ = HEAD_CAMERA_RPY_RAD
    # A MuJoCo camera looks along -z with y up: x is the body's -y, y is forward-and-up.
    ElementTree.SubElement(
        torso,
        "camera",
        name="head_camera",
        pos=_text(HEAD_CAMERA_XYZ_M),
        xyaxes=f"0 -1 0 {math.sin(pitch)!r} 0 {math.cos(pitch)!r}",
        fovy=f"{math.degrees(fovy_rad)!r}",
        resolution=f"{width} {height}",
    )


def _text(values: tuple[float, ...]) -> str:
    return " ".join(f"{value!r}" for value in values)
