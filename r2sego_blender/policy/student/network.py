"""The student's network: convolutions over a head image, a GRU over time, and three heads."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import nn

from .targets import PICTURE_SHAPE, SEAT_TARGETS

ACTION_SIZE = 4
"""vx, vy and yaw rate as shares of the drive's limits, and sit."""

_CHANNELS = (16, 32, 48, 64)
_FEATURES, _BODY, _STATE = 160, 64, 192
# Proprioception farther from its mean than this many deviations says no more.
_MOST_DEVIATIONS = 5.0


class Output(NamedTuple):
    """What the network says of B sequences of T frames.

    ``commands`` (B, T, 3) float32, shares of the limits, unbounded; ``sit`` (B, T), a logit; ``seat`` (B, T,
    SEAT_TARGETS) as ``targets.seat_target``, the last a logit; ``state`` (B, S), to go on from.
    """

    commands: torch.Tensor
    sit: torch.Tensor
    seat: torch.Tensor
    state: torch.Tensor


class Student(nn.Module):
    """Head images and proprioception to actions; about half a million parameters.

    ``proprio_mean`` and ``proprio_deviation`` (P,) are buffers that scale the proprioception: 0 and 1 until
    they are set from data.
    """

    proprio_mean: torch.Tensor
    proprio_deviation: torch.Tensor

    def __init__(self, proprio_size: int) -> None:
        super().__init__()
        self.register_buffer("proprio_mean", torch.zeros(proprio_size))
        self.register_buffer("proprio_deviation", torch.ones(proprio_size))
        layers: list[nn.Module] = []
        before = PICTURE_SHAPE[2]
        for index, channels in enumerate(_CHANNELS):
            size = 5 if index == 0 else 3
            layers += [nn.Conv2d(before, channels, size, stride=2, padding=size // 2), nn.ReLU()]
            before = channels
        layers += [nn.Conv2d(before, 24, 1), nn.ReLU(), nn.Flatten()]
        cells = 24 * (PICTURE_SHAPE[0] >> len(_CHANNELS)) * (PICTURE_SHAPE[1] >> len(_CHANNELS))
        self.eye = nn.Sequential(*layers, nn.Linear(cells, _FEATURES), nn.LayerNorm(_FEATURES), nn.ReLU())
        self.body = nn.Sequential(nn.Linear(proprio_size, _BODY), nn.ReLU())
        self.memory = nn.GRU(_FEATURES + _BODY, _STATE, batch_first=True)
        self.action = nn.Sequential(nn.Linear(_STATE + _FEATURES + _BODY, 96), nn.ReLU(), nn.Linear(96, ACTION_SIZE))
        self.seat = nn.Linear(_STATE, SEAT_TARGETS)

    @property
    def proprio_size(self) -> int:
        """Numbers of proprioception."""
        return len(self.proprio_mean)

    def start(self, sequences: int = 1) -> torch.Tensor:
        """The state (B, S) of ``sequences`` that begin."""
        return torch.zeros(sequences, _STATE)

    def forward(self, rgb: torch.Tensor, proprio: torch.Tensor, state: torch.Tensor) -> Output:
        """What it says of ``rgb`` (B, T, 96, 128, 3) uint8, ``proprio`` (B, T, P) float32 and ``state`` (B, S)."""
        sequences, frames = rgb.shape[:2]
        pictures = rgb.flatten(0, 1).permute(0, 3, 1, 2).to(torch.float32) / 127.5 - 1.0
        seen = self.eye(pictures).unflatten(0, (sequences, frames))
        scaled = (proprio - self.proprio_mean) / self.proprio_deviation
        felt = self.body(scaled.clamp(-_MOST_DEVIATIONS, _MOST_DEVIATIONS))
        now = torch.cat([seen, felt], dim=2)
        remembered, last = self.memory(now, state[None])
        said = self.action(torch.cat([remembered, now], dim=2))
        return Output(said[..., :3], said[..., 3], self.seat(remembered), last[0])


class Acting(nn.Module):
    """One step of a student: ``rgb`` (1, 96, 128, 3), ``proprio`` (1, P), ``state`` (1, S) -> (1, 4), (1, S).

    Actions are in [-1, 1]; sit is meant where the last is above 0.
    """

    def __init__(self, student: Student) -> None:
        super().__init__()
        self.student = student

    def forward(
        self, rgb: torch.Tensor, proprio: torch.Tensor, state: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        output = self.student(rgb[:, None], proprio[:, None], state)
        sit = torch.tanh(0.5 * output.sit[:, 0, None])
        return torch.cat([output.commands[:, 0].clamp(-1.0, 1.0), sit], dim=1), output.state
