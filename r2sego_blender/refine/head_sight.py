"""What a student sees in a rollout: the round's visual asset, with the robot's own body in it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..robot.model.model import RobotModel
from ..robot.model.mount import CameraMount
from ..splats.asset import SplatAsset
from ..splats.kernels.packing import PackedGaussians
from ..views.head_image import HeadCamera, HeadView
from ..views.room_looks import SplatLooks


@dataclass(frozen=True)
class HeadSight:
    """Serves ``student.Sight`` with ``asset``, for the robot of a file or name and its ``mount``.

    It is handed to the processes that simulate, where each makes its own camera.
    """

    asset: SplatAsset
    robot: str
    mount: CameraMount

    def __call__(self, qpos: np.ndarray, mount: CameraMount) -> np.ndarray:
        """(96, 128, 3) uint8 from the head of the robot at ``qpos`` (nq,)."""
        return self._camera.see(qpos, HeadView.of(replace(self._model, mount=mount))).colour

    @cached_property
    def _model(self) -> RobotModel:
        return RobotModel.load(self.robot, self.mount)

    @cached_property
    def _camera(self) -> HeadCamera:
        return HeadCamera(SplatLooks(PackedGaussians.of(self.asset)), self._model)
