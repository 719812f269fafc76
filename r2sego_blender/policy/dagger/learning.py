"""Learning from recorded episodes: truncated backpropagation through time, many episodes side by side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch.nn import functional

from ..student.network import Output, Student
from .episodes import Episode, EpisodeStore
from .settings import DaggerSettings

# Errors of the commands, shares of the limits, beyond this count by their size, not its square:
# where the teacher's command jumps, the student is not to give the mean.
_SMALL = 0.1
_DISTANCE_M = 3.0
_MOST_GRADIENT = 1.0


@dataclass(frozen=True)
class Losses:
    """Means over the frames of an update, or of several."""

    commands: float
    sit: float
    seat: float

    @staticmethod
    def none() -> Losses:
        """The mean of no updates."""
        return Losses(0.0, 0.0, 0.0)

    def with_one(self, other: Losses, count: int) -> Losses:
        """The mean of ``count`` updates, of which ``self`` is that of the first ones and ``other`` the last."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Losses(*(mean + (value - mean) / count for mean, value in pairs))

    def __str__(self) -> str:
        return f"commands {self.commands:.4f}, sit {self.sit:.4f}, seat {self.seat:.4f}"


def scale_proprio(student: Student, episodes: Sequence[Episode]) -> None:
    """Set what the student scales its proprioception by, from episodes."""
    proprio = np.concatenate([episode.proprio for episode in episodes]).astype(np.float64)
    student.proprio_mean.copy_(torch.from_numpy(proprio.mean(axis=0)))
    student.proprio_deviation.copy_(torch.from_numpy(np.maximum(proprio.std(axis=0), 1e-2)))


def learn(
    student: Student,
    optimizer: torch.optim.Adam,
    store: EpisodeStore,
    count: int,
    settings: DaggerSettings,
    iteration: int,
    epoch: int,
) -> Iterator[tuple[int, Losses]]:
    """One pass over the episodes 0 to ``count``: after each update, how many episodes are done, and its losses.

    The order and the changes of pictures come of the settings' seed, the iteration and the epoch alone.
    """
    rng = np.random.default_rng([settings.seed, iteration, epoch])
    order = rng.permutation(count)
    passes = settings.epochs_of(iteration)
    student.train()
    for begin in range(0, count, settings.sequences):
        for group in optimizer.param_groups:
            group["lr"] = settings.rate(iteration, (epoch + begin / count) / passes)
        batch = _Batch([store[int(number)] for number in order[begin : begin + settings.sequences]], settings, rng)
        done = min(begin + settings.sequences, count)
        for losses in batch.updates(student, optimizer):
            yield done, losses


class _Batch:
    """Episodes walked through side by side, the longest first."""

    def __init__(self, episodes: list[Episode], settings: DaggerSettings, rng: np.random.Generator) -> None:
        self._episodes = sorted(episodes, key=len, reverse=True)
        self._settings = settings
        shift, share = settings.shift_px, settings.brightness
        count = len(episodes)
        self._shifts = rng.integers(-shift, shift + 1, (count, 2))
        # A gain for all, and a little of another for each channel.
        gains = rng.uniform(1.0 - share, 1.0 + share, (count, 1)) * rng.uniform(1.0 - 0.2 * share, 1.0, (count, 3))
        levels = np.arange(256.0)[:, None]
        self._levels = np.clip(np.rint(levels * gains[:, None]), 0, 255).astype(np.uint8)  # (count, 256, 3)

    def updates(self, student: Student, optimizer: torch.optim.Adam) -> Iterator[Losses]:
        state = student.start(len(self._episodes))
        for begin in range(0, len(self._episodes[0]), self._settings.window_steps):
            running = sum(len(episode) > begin for episode in self._episodes)
            rgb, proprio, actions, seat, mask = self._window(begin, running)
            output = student(rgb, proprio, state[:running])
            state = output.state.detach()
            commands, sit, pose = _losses(output, actions, seat, mask)
            loss = commands + self._settings.sit_weight * sit + self._settings.seat_weight * pose
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(student.parameters(), _MOST_GRADIENT)
            optimizer.step()
            yield Losses(float(commands.detach()), float(sit.detach()), float(pose.detach()))

    def _window(self, begin: int, running: int) -> tuple[torch.Tensor, ...]:
        """The ``running`` longest episodes from step ``begin`` on, padded with zeros, and what is not padding."""
        episodes = self._episodes[:running]
        frames = min(self._settings.window_steps, len(episodes[0]) - begin)
        first = episodes[0]
        rgb = np.zeros((running, frames, *first.pictures.shape[1:]), np.uint8)
        proprio, actions, seat = (
            np.zeros((running, frames, part.shape[1]), np.float32)
            for part in (first.proprio, first.actions, first.seat)
        )
        mask = np.zeros((running, frames), bool)
        for row, episode in enumerate(episodes):
            steps = slice(begin, begin + frames)
            there = len(episode.actions[steps])
            rgb[row, :there] = self._changed(episode.pictures[steps], row)
            proprio[row, :there], actions[row, :there] = episode.proprio[steps], episode.actions[steps]
            seat[row, :there], mask[row, :there] = episode.seat[steps], True
        arrays = rgb, proprio, actions, seat, mask
        return tuple(map(torch.from_numpy, arrays))

    def _changed(self, pictures: np.ndarray, row: int) -> np.ndarray:
        """Pictures (n, H, W, 3) shifted, their edges repeated, and brighter or darker."""
        rows, columns = (
            np.clip(np.arange(size) + shift, 0, size - 1)
            for size, shift in zip(pictures.shape[1:3], self._shifts[row], strict=True)
        )
        shifted = np.take(np.take(pictures, rows, axis=1), columns, axis=2)
        return np.stack([self._levels[row, :, channel][shifted[..., channel]] for channel in range(3)], axis=-1)


def _losses(output: Output, actions: torch.Tensor, seat: torch.Tensor, mask: torch.Tensor) -> list[torch.Tensor]:
    """Of the commands, of sitting and of the seat's pose, means over the frames that ``mask`` (B, T) has."""
    wanted, said = actions[mask], output.commands[mask]
    commands = functional.smooth_l1_loss(said, wanted[:, :3], beta=_SMALL)
    sit = functional.binary_cross_entropy_with_logits(output.sit[mask], (wanted[:, 3] > 0.0).float())
    known = mask & ~seat[..., 0].isnan()
    if not known.any():
        return [commands, sit, commands.new_zeros(())]
    there, guessed = seat[known], output.seat[known]
    distance = functional.smooth_l1_loss(guessed[:, 0], there[:, 0] / _DISTANCE_M)
    angles = functional.mse_loss(guessed[:, 1:5], there[:, 1:5])
    in_view = functional.binary_cross_entropy_with_logits(guessed[:, 5], there[:, 5])
    return [commands, sit, distance + angles + 0.2 * in_view]
