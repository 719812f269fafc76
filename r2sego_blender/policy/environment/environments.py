"""The Gymnasium environments of a bundle: sit down, and walk to a place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, cast

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

from ...core.errors import SettingsError
from ...robot.controllers.commanded_drive import DriveCommand, DriveLimits
from ...robot.controllers.drive_actions import MOST, SIZE, command_of, proprioception_size
from ...robot.planning.course import require_legs
from ...robot.planning.free_floor import FreeFloor
from ...views.drawn_bodies import DrawnBody
from ...views.head_image import SIZE_PX, HeadCamera, HeadView
from ...views.room_looks import RoomLooks, Sight, SplatLooks
from .chairs import CHAIRS
from .episode import STEP_S, Episode
from .randomization import Randomization
from .reference_room import REFERENCE_RANDOMIZATION, ReferenceRoom
from .starts import Start, draw_start
from .state import PrivilegedState
from .training_scene import TrainingScene

Observation = dict[str, np.ndarray]

_RENDER_MODES = ("rgb_array", "depth_array", "rgbd_tuple")
_FARTHEST_M = 100.0


class _BundleEnv(gymnasium.Env[Observation, np.ndarray]):
    """What both tasks share.

    A step is 0.1 s. The observation's ``head`` is the head camera's picture and ``proprio`` gravity
    and angular velocity in the base's frame, the joints from their rest, their velocities, and the
    last action. ``info`` has the ``state``, a PrivilegedState, ``is_success``, and what a failure was
    in ``detail``. The reward is 1 in the step that succeeds; that step, and one that fails, ends the
    episode, and ``max_seconds`` cut it off.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (as Gymnasium declares it)
        "render_modes": list(_RENDER_MODES),
        "render_fps": round(1.0 / STEP_S),
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    sits: ClassVar[bool]

    def __init__(
        self,
        bundle: str | Path,
        robot: str = "",
        scope: str = "",
        asset: str | Path = "",
        chairs: Sequence[str] = (),
        randomization: Randomization | None = None,
        reference: str | Path = "",
        max_seconds: float = 40.0,
        render_mode: str | None = None,
        tracker: str | Path = "",
    ) -> None:
        """Episodes in the refined scene ``bundle``.

        ``robot``, ``scope`` and ``asset`` stand in for the bundle's own. With ``chairs``, names of
        ``CHAIRS``, one of these kinds stands in every episode's room, and is what is sat on.
        With ``reference``, a reference room's folder, they take place there instead, on its geometry and in
        its light, and begin where those of the same seed begin in the scene. ``randomization`` is
        ``Randomization()`` if it is not given, in a reference room ``REFERENCE_RANDOMIZATION``. A ``tracker``, TWIST2's
        ONNX file, balances the robot in the embedded controller's place, unaided. Raises SettingsError for kinds and
        modes that are none, and what ``TrainingScene.open``, ``ReferenceRoom.open`` and ``Episode`` raise.
        """
        unknown = sorted(set(chairs) - set(CHAIRS))
        if unknown:
            raise SettingsError(f"there is no chair '{unknown[0]}'", cure=f"There are: {', '.join(CHAIRS)}.")
        if render_mode not in (None, *_RENDER_MODES):
            raise SettingsError(f"nothing is rendered as '{render_mode}'", cure=f"Say {', '.join(_RENDER_MODES)}.")
        self.render_mode = render_mode
        self.scene = TrainingScene.open(Path(bundle), robot, scope, self.sits, str(asset))
        if self.sits:
            require_legs(self.scene.robot, self.scene.scope)
        self.limits = DriveLimits()
        """What an action of 1 and of -1 is."""
        self._chairs = tuple(chairs)
        self._drawn_chairs = {name: DrawnBody.of(CHAIRS[name].shape()) for name in self._chairs}
        self._reference = ReferenceRoom.open(Path(reference), self.scene) if reference else None
        played: TrainingScene = self.scene
        looks: RoomLooks = SplatLooks(self.scene.asset)
        if self._reference is not None:
            played, looks = self._reference.scene, self._reference.looks
        usual = REFERENCE_RANDOMIZATION if reference else Randomization()
        self._randomization = randomization or usual
        self._max_steps = round(max_seconds / STEP_S)
        self._episode = Episode(played, self._chairs, self.limits, tracker)
        self._camera = HeadCamera(looks, self.scene.robot)
        self._start: Start | None = None
        self._sight: Sight | None = None
        self.action_space = spaces.Box(-1.0, 1.0, (SIZE,), np.float32)
        felt = proprioception_size(len(self._episode.composition.qpos_address))
        observed = spaces.Dict(
            {
                "head": spaces.Box(0, 255, (SIZE_PX[1], SIZE_PX[0], 3), np.uint8),
                "proprio": spaces.Box(-MOST, MOST, (felt,), np.float32),
                **self._more_spaces(),
            }
        )
        self.observation_space = cast("spaces.Space[Observation]", observed)

    @property
    def floor(self) -> FreeFloor:
        """Where the robot may stand in this episode: without its chair."""
        return self._episode.scene.floor if self._start is None else self._start.floor

    @property
    def state(self) -> PrivilegedState:
        """The true state now. Raises gymnasium's ResetNeeded before the first ``reset``."""
        self._require_start()
        return self._episode.state()

    @property
    def qpos(self) -> np.ndarray:
        """(nq,) float64: the robot's true configuration now."""
        return self._episode.data.qpos.copy()

    @property
    def head_view(self) -> HeadView:
        """How the head sees in this episode. Raises as ``state``."""
        self._require_start()
        return self._drawn.view

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode, drawn by ``seed`` alone if it is given.

        ``options`` may have the ``start`` (x, y, yaw) of the base, metres and radians, in place of the drawn one,
        or ``look_around``, "anywhere" or "near_target", for any heading and no way ahead.
        """
        super().reset(seed=seed)
        start = draw_start(self.scene, self.sits, self._chairs, self.np_random)
        if self._reference is not None:
            start = self._reference.start(start)
        drawn = self._randomization.drawn(self.np_random, HeadView.of(self.scene.robot))
        if options and "start" in options:
            start = start.at(*_start_of(options["start"]))
        elif options and "look_around" in options:
            start = start.looking_around(options["look_around"] == "near_target", self.np_random)
        self._start, self._drawn = start, drawn
        self._episode.start(start, drawn)
        self._steps, self._last_action = 0, np.zeros(SIZE, np.float32)
        return self.observed(), self._info()

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """A tenth of a second of an action (4,), see ``drive_actions``. Raises RobotError for what is none."""
        self._require_start()
        said = np.asarray(action, np.float32)
        command = self._command(said)
        self._last_action = np.clip(said, -1.0, 1.0)
        self._episode.step(command)
        self._steps += 1
        success = self._episode.succeeded
        ended = success or bool(self._episode.reason)
        truncated = not ended and self._steps >= self._max_steps
        if truncated:
            self._episode.time_out()
        return self.observed(), float(success), ended, truncated, self._info()

    def render(self) -> Any:
        """The picture of the last observation, its depth (H, W) float32 in metres, 0 for none, or both."""
        if self._sight is None:
            raise gymnasium.error.ResetNeeded("Call reset before render.")
        colour, depth_m = self._sight.colour.copy(), self._sight.depth_m.copy()
        return {"rgb_array": colour, "depth_array": depth_m, "rgbd_tuple": (colour, depth_m)}.get(
            self.render_mode or ""
        )

    def _more_spaces(self) -> dict[str, spaces.Box]:
        return {}

    def _more_observed(self) -> Observation:
        return {}

    def _require_start(self) -> None:
        if self._start is None:
            raise gymnasium.error.ResetNeeded("Call reset before step.")

    def _command(self, action: np.ndarray) -> DriveCommand:
        said = command_of(action, self.limits)
        return said if self.sits else replace(said, sit=False)

    def observed(self) -> Observation:
        """What the robot sees and feels now; ``reset`` and ``step`` return it."""
        assert self._start is not None
        chair = self._start.chair
        others = [] if chair is None else [(self._drawn_chairs[chair.name], chair.world_from_chair)]
        self._sight = self._camera.see(self._episode.earlier(self._drawn.latency_s), self._drawn.view, others)
        felt = self._episode.proprioception(self._last_action)
        return {"head": self._sight.colour.copy(), "proprio": felt, **self._more_observed()}

    def _info(self) -> dict[str, Any]:
        return {"state": self._episode.state(), "is_success": self._episode.succeeded, "detail": self._episode.detail}


class SitEnv(_BundleEnv):
    """Walk to the nearest seat of the room, or to the chair that was put in it, turn, and sit down.

    It succeeds when the seat has carried the robot for the scope's ``sit_on.hold_s``.
    """

    sits = True


class WalkEnv(_BundleEnv):
    """Walk to a place and stand there.

    The observation's ``goal`` (2,) is the place in the base's frame, metres ahead and to the left.
    """

    sits = False

    def _more_spaces(self) -> dict[str, spaces.Box]:
        return {"goal": spaces.Box(-_FARTHEST_M, _FARTHEST_M, (2,), np.float32)}

    def _more_observed(self) -> Observation:
        state = self._episode.state()
        assert state.goal_xy_m is not None
        offset = state.goal_xy_m - state.base_xy_m
        cos, sin = np.cos(state.yaw_rad), np.sin(state.yaw_rad)
        goal = np.array([cos * offset[0] + sin * offset[1], cos * offset[1] - sin * offset[0]], np.float32)
        return {"goal": np.clip(goal, -_FARTHEST_M, _FARTHEST_M)}


def _start_of(value: Any) -> tuple[np.ndarray, float]:
    numbers = np.asarray(value, np.float64)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise SettingsError("the start is not three finite numbers", cure="Give (x, y, yaw), metres and radians.")
    return numbers[:2].copy(), float(numbers[2])
