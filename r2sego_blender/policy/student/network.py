"""The student's network: convolutions over a head image, a GRU over time, and three heads."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import nn

from .targets import PICTURE_SHAPE, SEAT_TARGETS

FEATURES = 160
"""Numbers that the eye makes of a picture."""

LEVELS = 21
"""Of each command, from -1 to 1."""

PLACE_M = 2.0
"""Places and distances are learnt as multiples of it."""

_BODY, _STATE, _HIDDEN = 64, 192, 128
# A place is told to the memory by waves of 8 m and five halvings, a heading by its multiples 1, 2, 4 and 8: a few
# centimetres decide before a seat, and networks learn what is fine from such features (Tancik et al. 2020).
_LONGEST_WAVE_M, _OCTAVES, _TURNS = 8.0, 6, 4
# Proprioception farther from its mean than this many deviations says no more.
_MOST_DEVIATIONS = 5.0


class Output(NamedTuple):
    """What the network says of B sequences of T frames.

    ``levels`` (B, T, 3, LEVELS) float32, logits of each command's level; ``sit`` (B, T), a logit; ``seat`` (B, T,
    SEAT_TARGETS) as ``targets.seat_target``, the last a logit; ``state`` (B, S), to go on from.
    """

    levels: torch.Tensor
    sit: torch.Tensor
    seat: torch.Tensor
    state: torch.Tensor

    @property
    def commands(self) -> torch.Tensor:
        """(B, T, 3) in [-1, 1], shares of the limits: the mean over the likeliest level and its neighbours.

        A mean over all would be between left and right where either is right.
        """
        number = torch.arange(LEVELS)
        near = (number - self.levels.argmax(dim=-1, keepdim=True)).abs() <= 1
        weights = self.levels.softmax(dim=-1) * near
        return (weights * (2.0 * number / (LEVELS - 1) - 1.0)).sum(dim=-1) / weights.sum(dim=-1)


class Student(nn.Module):
    """Head images and proprioception to actions; half a million parameters.

    The eye is the convolutional network of Mnih et al. 2015 (Human-level control), for 96 x 128 pixels and with
    fewer features. ``localizer`` says of them alone where the eye is, which it learns first: (N, 4) place less
    ``place_mean`` in metres, cosine and sine of the heading, and (N, SEAT_TARGETS) the seat. ``proprio_mean`` and
    ``proprio_deviation`` (P,) scale the proprioception; all three buffers are 0 or 1 until they are set from data.
    """

    proprio_mean: torch.Tensor
    proprio_deviation: torch.Tensor
    place_mean: torch.Tensor

    def __init__(self, proprio_size: int) -> None:
        super().__init__()
        self.register_buffer("proprio_mean", torch.zeros(proprio_size))
        self.register_buffer("proprio_deviation", torch.ones(proprio_size))
        self.register_buffer("place_mean", torch.zeros(2))
        convolutions = (nn.Conv2d(3, 24, 8, 4, 2), nn.Conv2d(24, 48, 4, 2, 1), nn.Conv2d(48, 64, 3, 2, 1))
        layers = [layer for one in (*convolutions, nn.Conv2d(64, 24, 1)) for layer in (one, nn.ReLU())]
        cells = 24 * (PICTURE_SHAPE[0] // 16) * (PICTURE_SHAPE[1] // 16)
        self.eye = nn.Sequential(*layers, nn.Flatten(), nn.Linear(cells, FEATURES), nn.LayerNorm(FEATURES), nn.ReLU())
        where = 4 + SEAT_TARGETS
        self.localizer = nn.Sequential(nn.Linear(FEATURES, 96), nn.ReLU(), nn.Linear(96, where))
        self.body = nn.Sequential(nn.Linear(proprio_size, _BODY), nn.ReLU())
        now = FEATURES + where + 4 * _OCTAVES + 2 * _TURNS + _BODY
        self.memory = nn.GRU(now, _STATE, batch_first=True)
        known = _STATE + now
        self.action = nn.Sequential(nn.Linear(known, _HIDDEN), nn.ReLU(), nn.Linear(_HIDDEN, 3 * LEVELS + 1))
        self.seat = nn.Linear(known, SEAT_TARGETS)

    @property
    def proprio_size(self) -> int:
        """Numbers of proprioception."""
        return len(self.proprio_mean)

    def start(self, sequences: int = 1) -> torch.Tensor:
        """The state (B, S) of ``sequences`` that begin."""
        return torch.zeros(sequences, _STATE)

    def see(self, rgb: torch.Tensor) -> torch.Tensor:
        """Features (N, FEATURES) of pictures (N, 96, 128, 3) uint8."""
        features: torch.Tensor = self.eye(rgb.permute(0, 3, 1, 2).to(torch.float32) / 127.5 - 1.0)
        return features

    def follow(self, seen: torch.Tensor, proprio: torch.Tensor, state: torch.Tensor) -> Output:
        """What it says of features (B, T, FEATURES), ``proprio`` (B, T, P) float32 and ``state`` (B, S)."""
        scaled = (proprio - self.proprio_mean) / self.proprio_deviation
        felt = self.body(scaled.clamp(-_MOST_DEVIATIONS, _MOST_DEVIATIONS))
        where = self.localizer(seen).detach()
        now = torch.cat([seen, where, fourier_features(where[..., :4]), felt], dim=2)
        remembered, last = self.memory(now, state[None])
        known = torch.cat([remembered, now], dim=2)
        said = self.action(known)
        levels = said[..., : 3 * LEVELS].unflatten(-1, (3, LEVELS))
        return Output(levels, said[..., -1], self.seat(known), last[0])

    def forward(self, rgb: torch.Tensor, proprio: torch.Tensor, state: torch.Tensor) -> Output:
        """What it says of ``rgb`` (B, T, 96, 128, 3) uint8, ``proprio`` (B, T, P) float32 and ``state`` (B, S)."""
        return self.follow(self.see(rgb.flatten(0, 1)).unflatten(0, rgb.shape[:2]), proprio, state)


def fourier_features(pose: torch.Tensor) -> torch.Tensor:
    """Fourier features (..., 4 * _OCTAVES + 2 * _TURNS) of ``pose`` (..., 4), what the localizer says first."""
    waves = torch.cat([pose[..., :2] * (math.tau * PLACE_M / _LONGEST_WAVE_M * 2**n) for n in range(_OCTAVES)], dim=-1)
    length = (pose[..., 2:] ** 2).sum(dim=-1, keepdim=True).clamp_min(1e-6).sqrt()
    turns = [pose[..., 2:] / length]
    for _ in range(_TURNS - 1):
        cos, sin = turns[-1][..., :1], turns[-1][..., 1:]
        turns.append(torch.cat([cos * cos - sin * sin, 2.0 * cos * sin], dim=-1))
    return torch.cat([waves.sin(), waves.cos(), *turns], dim=-1)


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
        return torch.cat([output.commands[:, 0], sit], dim=1), output.state
