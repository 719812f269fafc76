"""The head camera's mount ``^B T_C``: a camera fixed to one of the robot's bodies."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ...core.cameras import Camera
from ...core.errors import RobotError

# Columns: the OpenCV axes (right, down, forward) in a frame with x forward, y left, z up.
_BODY_FROM_OPENCV = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])

MUJOCO_FROM_OPENCV = np.diag([1.0, -1.0, -1.0])
"""MuJoCo's camera looks along -z with y up; OpenCV's along z with y down."""

_MOST_RAD = 6.3  # degrees in their place are nearly always larger
_CURE = "Write [parent, [x, y, z], [roll, pitch, yaw], {hfov_deg = 69}] in metres and radians."


@dataclass(frozen=True)
class CameraMount:
    """A camera on body ``parent`` of a robot.

    ``parent_from_camera`` (4, 4) float64, OpenCV camera axes, metres. The field of view
    is ``fov_deg`` across the image's width or, where ``vertical``, its height. A lens that is
    known better has its ``focal`` lengths and its ``principal`` point, x and y from the upper
    left corner, as shares of the image's width and height.
    """

    parent: str
    parent_from_camera: np.ndarray
    fov_deg: float
    vertical: bool = False
    focal: tuple[float, float] | None = None
    principal: tuple[float, float] = (0.5, 0.5)

    @property
    def pitch_down_deg(self) -> float:
        """The angle below the parent's horizontal at which the camera looks."""
        return math.degrees(math.asin(np.clip(-self.parent_from_camera[2, 2], -1.0, 1.0)))

    def pitched(self, down_deg: float) -> CameraMount:
        """This mount, tilted about the camera's lateral axis to look ``down_deg`` down."""
        turn = Rotation.from_euler("x", self.pitch_down_deg - down_deg, degrees=True)
        tilted = self.parent_from_camera.copy()
        tilted[:3, :3] = tilted[:3, :3] @ turn.as_matrix()
        return replace(self, parent_from_camera=tilted)

    def camera(self, width: int, height: int) -> Camera:
        """The lens at the identity pose, with square pixels where only the field of view is known."""
        if self.focal is None:
            across = height if self.vertical else width
            fx = fy = 0.5 * across / math.tan(math.radians(self.fov_deg) / 2.0)
        else:
            fx, fy = self.focal[0] * width, self.focal[1] * height
        return Camera(width, height, fx, fy, self.principal[0] * width, self.principal[1] * height, np.eye(4))


def mount_on(
    bodies: Sequence[str], value: CameraMount | Mapping[str, Any] | Sequence[Any], where: object
) -> CameraMount:
    """The mount, or that of ``parse_mount``. Raises RobotError when its parent is not among ``bodies``."""
    mount = value if isinstance(value, CameraMount) else parse_mount(value, where)
    if mount.parent not in bodies:
        raise RobotError(f"the robot has no body '{mount.parent}'", where=where, cure=f"It has: {', '.join(bodies)}.")
    return mount


def parse_mount(value: Mapping[str, Any] | Sequence[Any], where: object) -> CameraMount:
    """The mount of ``[parent, xyz, rpy, fov]`` or of a table with these keys.

    ``xyz`` metres, ``rpy`` radians (fixed axes, as in URDF: the camera's frame has x
    forward, y left, z up); ``fov`` is ``{"hfov_deg": ..}``, ``{"fovy_deg": ..}`` or a number,
    which is the vertical field of view as in MJCF. Raises RobotError naming the field.
    """
    fov: Any
    if isinstance(value, Mapping):
        fov = {key: value[key] for key in ("hfov_deg", "fovy_deg") if key in value}
        parts: list[Any] = [value.get("parent"), value.get("xyz"), value.get("rpy"), fov]
        unknown = set(value) - {"parent", "xyz", "rpy", "hfov_deg", "fovy_deg"}
        if unknown:
            raise RobotError(f"the mount has no field '{min(unknown)}'", where=where, cure=_CURE)
    else:
        parts = [] if isinstance(value, str) else list(value)
    if len(parts) != 4 or not isinstance(parts[0], str):
        raise RobotError("the mount is not four values", where=where, cure=_CURE)
    parent, xyz, rpy, fov = parts
    if not isinstance(fov, Mapping):
        fov = {"fovy_deg": fov}
    if len(fov) != 1 or not set(fov) <= {"hfov_deg", "fovy_deg"}:
        raise RobotError("the mount's field of view is not one angle", where=where, cure=_CURE)
    ((axis, fov_deg),) = fov.items()
    pose = np.eye(4)
    pose[:3, 3] = _numbers(xyz, 3, "xyz", where)
    roll_pitch_yaw = _numbers(rpy, 3, "rpy", where)
    if np.abs(roll_pitch_yaw).max() > _MOST_RAD:
        raise RobotError(
            f"the mount's rpy is {np.abs(roll_pitch_yaw).max():g}, more than a turn",
            where=where,
            cure="Write radians: 45 degrees are 0.785.",
        )
    pose[:3, :3] = Rotation.from_euler("xyz", roll_pitch_yaw).as_matrix() @ _BODY_FROM_OPENCV
    (fov_deg,) = _numbers([fov_deg], 1, axis, where)
    if not 1.0 <= fov_deg <= 170.0:
        raise RobotError(f"the mount's {axis} is {fov_deg}", where=where, cure="Give 1 to 170 degrees.")
    return CameraMount(parent, pose, fov_deg, vertical=axis == "fovy_deg")


def _numbers(value: Any, count: int, field: str, where: object) -> np.ndarray:
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise RobotError(f"the mount's {field} is not {count} finite numbers", where=where, cure=_CURE)
    return numbers
