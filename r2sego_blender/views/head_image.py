"""What the head camera sees: the room, and bodies in it where they are."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numba
import numpy as np

from ..core.cameras import Camera
from ..core.colours import linear_from_srgb, srgb_from_linear
from ..core.images import to_uint8
from ..robot.controllers.seeing_policy import HEAD_PICTURE
from ..robot.model.model import RobotModel
from ..robot.rollouts.bodies import body_shapes
from .drawn_bodies import DrawnBody, draw_bodies
from .room_looks import RoomLooks, Sight

SIZE_PX = HEAD_PICTURE[1], HEAD_PICTURE[0]
"""Width and height of the head's pictures."""

_AS_IT_IS = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class HeadView:
    """How the head sees during one episode.

    ``lens`` at any pose; ``parent_from_camera`` (4, 4) is where it is mounted on its body; ``gains``
    multiply red, green and blue in linear light; ``light`` is the unit vector to the light that shades
    bodies, in the world frame.
    """

    lens: Camera
    parent_from_camera: np.ndarray
    gains: tuple[float, float, float] = _AS_IT_IS
    light: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @staticmethod
    def of(robot: RobotModel, size_px: tuple[int, int] = SIZE_PX) -> HeadView:
        """As the robot declares its camera."""
        return HeadView(robot.mount.camera(*size_px), robot.mount.parent_from_camera)

    def exposed(self, pixels: np.ndarray) -> np.ndarray:
        """(H, W, 3) uint8 with the gains; the same pixels where there are none."""
        if self.gains == _AS_IT_IS:
            return pixels
        return np.take_along_axis(self._levels, pixels.reshape(-1, 3), axis=0).reshape(pixels.shape)

    @cached_property
    def _levels(self) -> np.ndarray:
        """(256, 3) uint8: what becomes of each level of each channel."""
        linear = linear_from_srgb(np.arange(256) / 255.0)
        return to_uint8(srgb_from_linear(linear[:, None] * np.array(self.gains, np.float32)))


class HeadCamera:
    """Sees a room from a robot's head, and in it the robot's own body and others.

    The world frame is the room's. A picture takes one thread and no OpenGL, and the same state gives the
    same bytes.
    """

    def __init__(self, room: RoomLooks, robot: RobotModel) -> None:
        self._room = room
        self._robot, self._data = robot, mujoco.MjData(robot.model)
        self._parent = robot.model.body(robot.mount.parent).id
        self._own = [(shape.body, DrawnBody.of(shape)) for shape in body_shapes(robot.model)]

    def see(self, qpos: np.ndarray, view: HeadView, others: Sequence[tuple[DrawnBody, np.ndarray]] = ()) -> Sight:
        """The picture from the head of the robot at ``qpos`` (nq,).

        ``others`` are further bodies with their poses ``world_from_body`` (4, 4). Where no body is in
        view the colours are, before the view's gains, the room's own to the bit.
        """
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._robot.model, self._data)
        camera = view.lens.at(self._pose(self._parent) @ view.parent_from_camera)
        bodies = [*((drawn, self._pose(body)) for body, drawn in self._own), *others]
        with _one_thread():
            seen = self._room.seen(camera, draw_bodies(bodies, camera, np.array(view.light)))
        return replace(seen, colour=view.exposed(seen.colour))

    def _pose(self, body: int) -> np.ndarray:
        """``world_from_body`` (4, 4) at the last configuration."""
        pose = np.eye(4)
        pose[:3, :3] = self._data.xmat[body].reshape(3, 3)
        pose[:3, 3] = self._data.xpos[body]
        return pose


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """Pictures are small: environments run side by side in processes, and threads would only wait."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        yield
    finally:
        numba.set_num_threads(before)
