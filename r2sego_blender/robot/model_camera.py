"""A camera of a MuJoCo model: put on a body, and as it stands in a simulation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from ..cameras import Camera
from ..errors import RobotError
from .mount import MUJOCO_FROM_OPENCV, CameraMount, mount_on


def add_camera(
    spec: mujoco.MjSpec,
    name: str,
    mount: Mapping[str, Any] | Sequence[Any],
    size_px: tuple[int, int] = (640, 480),
) -> None:
    """Put a camera on a body of ``spec``, at a mount as behaviour scopes declare them.

    That is ``[parent, [x, y, z], [roll, pitch, yaw], {"hfov_deg": 69}]``, metres and radians, in
    the body's frame; see ``parse_mount``. ``size_px``, width and height, turn a field of view
    across into MuJoCo's, which is upright. Raises RobotError naming the field, or when there is
    no such body.
    """
    parsed = mount_on([body.name for body in spec.bodies[1:]], mount, f"the mount of '{name}'")
    lens = parsed.camera(*size_px)
    turn = np.empty(4)
    mujoco.mju_mat2Quat(turn, (parsed.parent_from_camera[:3, :3] @ MUJOCO_FROM_OPENCV).ravel())
    fovy = math.degrees(2.0 * math.atan(lens.height / 2.0 / lens.fy))
    spec.body(parsed.parent).add_camera(name=name, pos=parsed.parent_from_camera[:3, 3], quat=turn, fovy=fovy)


def model_camera(model: mujoco.MjModel, data: mujoco.MjData, name: str, width: int, height: int) -> Camera:
    """The model's camera ``name`` at its pose in ``data``, with ``width`` x ``height`` pixels.

    The lens is what MuJoCo renders with: ``fovy``, or where the camera has a ``sensorsize``
    its focal lengths and principal point, which move with the sensor's size in pixels.
    ``data`` must know the bodies' places: ``mj_forward`` or ``mj_step`` was called. Raises
    RobotError when it does not, when there is no such camera, or when it has no perspective.
    """
    names = [model.camera(index).name for index in range(model.ncam)]
    if name not in names:
        cure = f"It has: {', '.join(names)}." if names else "It has none."
        raise RobotError(f"the model has no camera '{name}'", cure=cure)
    camera = names.index(name)
    if model.cam_projection[camera] != mujoco.mjtProjection.mjPROJ_PERSPECTIVE:
        raise RobotError(
            f"the model's camera '{name}' has no perspective",
            cure='Give one without projection="orthographic".',
        )
    turn = data.cam_xmat[camera].reshape(3, 3)
    if not (np.isfinite(data.cam_xpos[camera]).all() and abs(np.linalg.det(turn) - 1.0) < 1e-3):
        raise RobotError(
            f"the camera '{name}' stands nowhere yet, or the simulation has become unstable",
            cure="Call mujoco.mj_forward(model, data) or mj_step before, and look at data.warning.",
        )
    pose = np.eye(4)
    pose[:3, :3] = turn @ MUJOCO_FROM_OPENCV
    pose[:3, 3] = data.cam_xpos[camera]
    sensor = model.cam_sensorsize[camera]
    if sensor[1] == 0:
        fixed = CameraMount("world", pose, float(model.cam_fovy[camera]), vertical=True)
        return fixed.camera(width, height).at(pose)
    focal, offset = np.split(model.cam_intrinsic[camera].astype(np.float64), 2)
    size_px = np.array([width, height])
    lens = np.concatenate([focal / sensor * size_px, (0.5 - offset / sensor) * size_px])
    return Camera(width, height, *map(float, lens), pose)
