"""What a robot's camera sees in MuJoCo: the room as splats, and the bodies before them."""

from __future__ import annotations

from types import TracebackType

import mujoco
import numpy as np

from ..core.cameras import Camera
from ..core.errors import MachineError, RobotError
from ..core.images import to_uint8
from ..robot.model.model_camera import model_camera
from ..splats.asset import SplatAsset
from ..splats.rendering.rasterizer import render
from ..views.room_looks import Sight

_NEARLY_FAR = 0.99

_DEPTH_TOLERANCE_M = 0.05
"""Splats lie this much before what they show: else feet would sink into the floor."""


class SimulatedCamera:
    """A camera of a MuJoCo model that sees ``asset``, and before it what MuJoCo draws.

    MuJoCo draws the geoms of groups 0 to 2; the room's collision surface belongs in a group
    that is not drawn, 3 to 5. Where a drawn geom is nearer than the splats, or just behind
    their front, its pixel is seen. The model's frame is the asset's: world frame, metres, Z up.
    ``size_px`` are width and height. To be closed, or used in a ``with`` statement: it holds an
    OpenGL context. Raises MachineError when there is none to have, RobotError for a size of no image.
    """

    def __init__(
        self, model: mujoco.MjModel, name: str, asset: SplatAsset, size_px: tuple[int, int] = (640, 480)
    ) -> None:
        if len(size_px) != 2 or not all(isinstance(side, int | np.integer) and side > 0 for side in size_px):
            raise RobotError(
                f"size_px is {size_px}, and no image has that size", cure="Give width and height: (640, 480)."
            )
        self._model, self._name, self._asset, self._size_px = model, name, asset, size_px
        self._renderer = _renderer(model, *size_px)

    def camera(self, data: mujoco.MjData) -> Camera:
        """Lens and pose at this moment of the simulation. Raises RobotError where it has none."""
        return model_camera(self._model, data, self._name, *self._size_px)

    def see(self, data: mujoco.MjData) -> Sight:
        """What the camera sees at this moment of the simulation."""
        room = render(self._asset, self.camera(data))
        self._renderer.update_scene(data, self._name)
        self._renderer.enable_depth_rendering()
        drawn_m = self._renderer.render()
        self._renderer.disable_depth_rendering()
        far_m = self._model.vis.map.zfar * self._model.stat.extent
        room_m = np.where(room.depth > 0.0, room.depth + _DEPTH_TOLERANCE_M, np.inf)
        body = drawn_m < np.minimum(room_m, _NEARLY_FAR * far_m)
        colour = to_uint8(room.colour)
        if body.any():
            colour[body] = self._renderer.render()[body]
        return Sight(colour, np.where(body, drawn_m, room.depth), body)

    def close(self) -> None:
        self._renderer.close()

    def __enter__(self) -> SimulatedCamera:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _renderer(model: mujoco.MjModel, width: int, height: int) -> mujoco.Renderer:
    """MuJoCo's, for any size, and without smooth borders: each pixel is a body's or the room's."""
    view, quality = model.vis.global_, model.vis.quality
    before = view.offwidth, view.offheight, quality.offsamples
    view.offwidth, view.offheight, quality.offsamples = width, height, 0
    try:
        return mujoco.Renderer(model, height, width)
    except mujoco.FatalError as error:
        raise MachineError(
            f"MuJoCo cannot draw here: {error}", cure="Without a screen, set MUJOCO_GL=egl before Python starts."
        ) from error
    finally:
        view.offwidth, view.offheight, quality.offsamples = before
