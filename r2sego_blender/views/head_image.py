"""What the head camera sees: the visual asset, and bodies among its Gaussians where they are."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
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
from ..splats.kernels.packing import PackedGaussians
from ..splats.rendering.rasterizer import Rasterizer
from ..splats.rendering.surfaces import in_front
from .drawn_bodies import DrawnBody, draw_bodies

SIZE_PX = HEAD_PICTURE[1], HEAD_PICTURE[0]
"""Width and height of the head's pictures."""

# Gaussians lie this much before what they show: else a foot would sink into the floor.
_BEFORE_M = 0.05
_LEAST_LIGHT = 1.0 / 512.0  # below it a body changes no level of its pixel
_AS_IT_IS = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Sight:
    """What a camera sees at one moment.

    ``colour`` (H, W, 3) uint8, sRGB; ``depth_m`` (H, W) float32, planar, 0 where nothing is;
    ``body`` (H, W) bool, where a body of the simulation is seen and not the room.
    """

    colour: np.ndarray
    depth_m: np.ndarray
    body: np.ndarray


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
    """Sees an asset from a robot's head, and in it the robot's own body and others.

    The world frame is the asset's. The asset is packed for the kernels once; a picture takes one
    thread and no OpenGL, and the same state gives the same bytes.
    """

    def __init__(self, asset: PackedGaussians, robot: RobotModel) -> None:
        self._asset, self._rasterizer = asset, Rasterizer()
        self._robot, self._data = robot, mujoco.MjData(robot.model)
        self._parent = robot.model.body(robot.mount.parent).id
        self._own = [(shape.body, DrawnBody.of(shape)) for shape in body_shapes(robot.model)]

    def see(self, qpos: np.ndarray, view: HeadView, others: Sequence[tuple[DrawnBody, np.ndarray]] = ()) -> Sight:
        """The picture from the head of the robot at ``qpos`` (nq,).

        ``others`` are further bodies with their poses ``world_from_body`` (4, 4). Where no body is in
        view the colours are, before the view's gains, those of ``render`` to the bit. A pixel is the
        body's share of what Gaussians before it let through, and theirs; ``Sight.body`` is where the
        greater part is a body's.
        """
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._robot.model, self._data)
        camera = view.lens.at(self._pose(self._parent) @ view.parent_from_camera)
        bodies = [*((drawn, self._pose(body)) for body, drawn in self._own), *others]
        with _one_thread():
            self._rasterizer.forward(self._asset, camera)
            room = self._rasterizer.rendering()
            drawn = draw_bodies(bodies, camera, np.array(view.light))
            body = np.zeros(camera.shape, bool)
            if drawn is not None:
                depth_m, colour = drawn
                before = in_front(self._rasterizer.tile_entries, np.where(depth_m > 0.0, depth_m - _BEFORE_M, 0.0))
                light = before.transmittance[..., None]
                reached = before.transmittance > _LEAST_LIGHT
                room.colour[reached] = (before.colour + light * colour)[reached]
                room.depth[reached] = (before.depth_sum + before.transmittance * depth_m)[reached]
                body = before.transmittance > 0.5
        return Sight(view.exposed(to_uint8(room.colour)), room.depth, body)

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
