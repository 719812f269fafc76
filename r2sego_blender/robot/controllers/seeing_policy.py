"""A policy that sees: head image, proprioception and what it remembers, to an action.

Its ONNX takes ``rgb`` (1, rows, columns, 3) uint8, ``proprio`` (1, P) and ``state`` (1, S) float32, zero at
first, and gives ``action`` (1, A) and ``next_state`` (1, S). It is opened and run as every stranger's file is,
in a process with nothing to write or reach (``policy_worker``); the state stays there.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...core.errors import RobotError
from ..model.mount import CameraMount
from .policy_networks import ONNX, PolicyRefusedError
from .policy_runtime import is_program, read_policy
from .policy_worker import PolicyFailedError, PolicyWorker

HEAD_PICTURE = (96, 128, 3)
"""Rows, columns and sRGB channels of a head's picture, uint8."""

Sight = Callable[[np.ndarray, CameraMount], np.ndarray]
"""``HEAD_PICTURE`` uint8 from the head of the robot at ``qpos`` (nq,), its camera at a mount."""

Act = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""An action (A,) float64 of ``rgb`` (rows, columns, 3) uint8 and ``proprio`` (P,) float32, with those before in mind.

Raises RobotError where the network fails, or its action is not finite.
"""


class SeeingPolicyFile:
    """A policy's ONNX file, read once and tried on a black picture.

    ``picture`` are rows, columns and channels. Raises RobotError as ``read_policy``, and: a program, other
    inputs, outputs or sizes, actions that are not finite, a network that damages, fills or outlasts its process.
    """

    def __init__(self, path: str | Path, picture: tuple[int, int, int], proprio_size: int, action_size: int) -> None:
        self.path, self._picture, self._sizes = Path(path), picture, (proprio_size, action_size)
        if is_program(self.path):
            raise self._error("a policy that sees is an ONNX file", "Export it as ONNX.")
        content = read_policy(self.path)
        try:
            self._worker = PolicyWorker(ONNX, content, proprio_size, str(path), picture)
        except PolicyFailedError as error:
            raise self._error(f"this policy cannot be opened: {error}", "Export the policy again.") from error
        self.start()(np.zeros(picture, np.uint8), np.zeros(proprio_size, np.float32))

    def start(self) -> Act:
        """The policy at the beginning of an episode, with nothing in mind. Raises RobotError."""
        try:
            network = self._worker.network()
        except PolicyRefusedError as error:
            raise self._error(error.what, error.cure) from error
        except PolicyFailedError as error:
            raise self._error(f"this policy cannot be opened: {error}", "Export the policy again.") from error
        proprio_size, action_size = self._sizes

        def act(rgb: np.ndarray, proprio: np.ndarray) -> np.ndarray:
            if rgb.shape != self._picture or rgb.dtype != np.uint8 or proprio.shape != (proprio_size,):
                raise ValueError(f"{rgb.dtype} {rgb.shape} and {proprio.shape} are not what it takes")
            told = proprio.astype("<f4", copy=False).tobytes()
            try:
                action = network(np.frombuffer(rgb.tobytes() + told, np.uint8))
            except PolicyFailedError as error:
                raise self._error(f"the policy failed while it was asked: {error}", "Export it again.") from error
            if action.shape != (action_size,):
                raise self._error(f"the network gives {action.size} actions, not {action_size}", "Export it again.")
            if not np.isfinite(action).all():
                raise self._error("the network's actions are not finite", "Train or export it again.")
            return action.astype(np.float64)

        return act

    def _error(self, what: str, cure: str) -> RobotError:
        return RobotError(what, where=self.path, cure=cure)
