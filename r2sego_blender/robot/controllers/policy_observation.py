"""What a policy observes: the layout's terms from the simulated state, and their history."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from .policy_layout import PER_TERM, PolicyLayout


@dataclass
class Command:
    """What the policy is told to do; angles of the waist: yaw, roll, pitch."""

    vx_m_s: float = 0.0
    vy_m_s: float = 0.0
    yaw_rate_rad_s: float = 0.0
    walks: bool = False
    base_height_m: float = 0.0
    waist_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Observer:
    """Builds a policy's observations, one after the other, of one attempt."""

    def __init__(self, layout: PolicyLayout, qpos_address: np.ndarray, dof_address: np.ndarray) -> None:
        """``qpos_address``, ``dof_address`` (joints,) int: where the layout's joints are."""
        self._layout, self._qpos_address, self._dof_address = layout, qpos_address, dof_address
        self._default = layout.default_rad
        self._reference = np.array([angle for _, angle in layout.upper_body])
        self._history: list[list[np.ndarray]] = []

    def observe(self, data: mujoco.MjData, command: Command, action: np.ndarray, time_s: float) -> np.ndarray:
        """(observation_size,) float32 of the state now; ``action`` (m,) is the last raw one.

        ``time_s`` since the attempt began drives the gait's phase. The free joint's linear
        velocity is the world's, its angular velocity the base's own (MuJoCo's convention).
        """
        layout = self._layout
        newest = []
        for term in layout.terms:
            value = self._value(term.name, term.period_s, data, command, action, time_s)
            newest.append(np.clip(value, -term.clip, term.clip) * term.scale)
        if not self._history:
            first = newest if layout.history_start == "first" else [np.zeros_like(one) for one in newest]
            self._history = [first] * layout.history
        self._history = [*self._history[1:], newest]
        if layout.history_order == PER_TERM:
            parts = [step[index] for index in range(len(layout.terms)) for step in self._history]
        else:
            parts = [value for step in self._history for value in step]
        return np.concatenate(parts).astype(np.float32)

    def _value(
        self, name: str, period_s: float, data: mujoco.MjData, command: Command, action: np.ndarray, time_s: float
    ) -> np.ndarray:
        match name:
            case "base_lin_vel":
                return _base_from_world(data.qpos[3:7]) @ data.qvel[:3]
            case "base_ang_vel":
                return data.qvel[3:6]
            case "projected_gravity":
                return -_base_from_world(data.qpos[3:7])[:, 2]
            case "velocity_command":
                return np.array([command.vx_m_s, command.vy_m_s, command.yaw_rate_rad_s])
            case "linear_velocity_command":
                return np.array([command.vx_m_s, command.vy_m_s])
            case "yaw_rate_command":
                return np.array([command.yaw_rate_rad_s])
            case "walk_flag":
                return np.array([float(command.walks)])
            case "stand_flag":
                return np.array([float(not command.walks)])
            case "base_height_command":
                return np.array([command.base_height_m])
            case "waist_command":
                return np.array(command.waist_rad)
            case "gait_phase":
                phase = math.tau * time_s / period_s
                return np.array([math.sin(phase), math.cos(phase)])
            case "joint_pos":
                return data.qpos[self._qpos_address]
            case "joint_pos_rel":
                return data.qpos[self._qpos_address] - self._default
            case "joint_vel_rel":
                return data.qvel[self._dof_address]
            case "last_action":
                return action
            case "upper_body_reference":
                return self._reference
        raise ValueError(name)


def _base_from_world(quaternion: np.ndarray) -> np.ndarray:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3).T
