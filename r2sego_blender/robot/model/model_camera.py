"""A camera of a MuJoCo model: put on a body, as it is mounted there, and as it stands in a simulation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from ...core.cameras import Camera
from ...core.errors import RobotError
from .mount import MUJOCO_FROM_OPENCV, CameraMount, mount_on


def add_camera(
    spec: mujoco.MjSpec, name: str, mount: Mapping[str, Any] | Sequence[Any], size_px: tuple[int, int] = (640, 480)
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


def eyes(model: mujoco.MjModel) -> list[str]:
    """The names of the cameras that move with their body: those that follow it from outside, or turn to
    something, see no robot's view."""
    fixed = np.flatnonzero(model.cam_mode == int(mujoco.mjtCamLight.mjCAMLIGHT_FIXED))
    return [model.camera(int(index)).name for index in fixed]


def mount_of(model: mujoco.MjModel, camera: int, where: object = None) -> CameraMount:
    """The model's camera with that id on its body, with the lens that MuJoCo renders with.

    That is ``fovy``, or where the camera has a ``sensorsize`` its focal lengths and principal
    point, which move with the sensor's size in pixels. Raises RobotError, about ``where``, for
    a camera without perspective.
    """
    if model.cam_projection[camera] != mujoco.mjtProjection.mjPROJ_PERSPECTIVE:
        raise RobotError(
            f"the camera '{model.camera(camera).name}' has no perspective",
            where=where,
            cure='Give one without projection="orthographic".',
        )
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.cam_quat[camera])
    pose = np.eye(4)
    pose[:3, :3] = turn.reshape(3, 3) @ MUJOCO_FROM_OPENCV
    pose[:3, 3] = model.cam_pos[camera]
    parent = model.body(model.cam_bodyid[camera]).name
    mount = CameraMount(parent, pose, float(model.cam_fovy[camera]), vertical=True)
    sensor = model.cam_sensorsize[camera].astype(np.float64)
    focal, offset = np.split(model.cam_intrinsic[camera].astype(np.float64), 2)
    lens = [mount.fov_deg, *((*focal, *sensor) if sensor[1] != 0.0 else ())]
    if not (min(lens) > 0.0 and np.isfinite([*lens, *offset, *pose.ravel()]).all() and mount.fov_deg < 180.0):
        raise RobotError(
            f"the camera '{model.camera(camera).name}' has no lens that sees anything",
            where=where,
            cure="Give a fovy between 0 and 180 degrees, or positive focal lengths and a sensor's size.",
        )
    if sensor[1] == 0.0:
        return mount
    (fx, fy), (cx, cy) = (focal / sensor).tolist(), (0.5 - offset / sensor).tolist()
    return replace(mount, focal=(fx, fy), principal=(cx, cy))


def model_camera(model: mujoco.MjModel, data: mujoco.MjData, name: str, width: int, height: int) -> Camera:
    """The model's camera ``name`` at its pose in ``data``, with ``width`` x ``height`` pixels.

    The lens is that of ``mount_of``. ``data`` must know the bodies' places: ``mj_forward`` or
    ``mj_step`` was called. Raises RobotError when it does not, when there is no such camera, or
    when it has no perspective.
    """
    names = [model.camera(index).name for index in range(model.ncam)]
    if name not in names:
        cure = f"It has: {', '.join(names)}." if names else "It has none."
        raise RobotError(f"the model has no camera '{name}'", cure=cure)
    camera = names.index(name)
    lens = mount_of(model, camera).camera(width, height)
    turn = data.cam_xmat[camera].reshape(3, 3)
    if not (np.isfinite(data.cam_xpos[camera]).all() and abs(np.linalg.det(turn) - 1.0) < 1e-3):
        raise RobotError(
            f"the camera '{name}' stands nowhere yet, or the simulation has become unstable",
            cure="Call mujoco.mj_forward(model, data) or mj_step before, and look at data.warning.",
        )
    pose = np.eye(4)
    pose[:3, :3] = turn @ MUJOCO_FROM_OPENCV
    pose[:3, 3] = data.cam_xpos[camera]
    return lens.at(pose)
