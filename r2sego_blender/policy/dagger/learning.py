"""Learning from recorded episodes: truncated backpropagation through time, many episodes side by side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch.nn import functional
from torch.nn.utils.rnn import pad_sequence

from ..student.network import Output, Student
from .episodes import Episode
from .losses import seat_loss, two_hot
from .settings import DaggerSettings

_MOST_GRADIENT = 1.0
_PICTURES = 64  # that the eye sees at a time


@dataclass(frozen=True)
class SeenEpisode:
    """T steps of an episode as the eye saw them: ``seen`` (T, FEATURES), the rest as an ``Episode`` has it."""

    seen: torch.Tensor
    proprio: torch.Tensor
    actions: torch.Tensor
    seat: torch.Tensor

    def __len__(self) -> int:
        return len(self.seen)

    @staticmethod
    def of(episode: Episode, student: Student) -> SeenEpisode:
        """Through the eye of ``student``, which does not learn from it."""
        with torch.no_grad():
            parts = np.array_split(episode.pictures, -(-len(episode) // _PICTURES))
            seen = torch.cat([student.see(torch.from_numpy(np.array(part))) for part in parts])
        return SeenEpisode(seen, *map(torch.from_numpy, (episode.proprio, episode.actions, episode.seat)))


def scale(student: Student, episodes: Sequence[Episode], views: Sequence[Episode]) -> None:
    """Set what the student scales its proprioception by, and where its room is."""
    proprio = np.concatenate([episode.proprio for episode in episodes]).astype(np.float64)
    student.proprio_mean.copy_(torch.from_numpy(proprio.mean(axis=0)))
    student.proprio_deviation.copy_(torch.from_numpy(np.maximum(proprio.std(axis=0), 1e-2)))
    places = np.concatenate([view.base_poses[:, :2] for view in views]).astype(np.float64)
    student.place_mean.copy_(torch.from_numpy(places.mean(axis=0)))


def learn(
    student: Student,
    optimizer: torch.optim.Adam,
    episodes: Sequence[SeenEpisode],
    settings: DaggerSettings,
    iteration: int,
    epoch: int,
) -> Iterator[tuple[int, dict[str, float]]]:
    """One pass over the episodes: after each update, how many are done, and its losses.

    The order comes of the settings' seed, the iteration and the epoch alone.
    """
    rng = np.random.default_rng([settings.seed, iteration, epoch])
    order, count, window = rng.permutation(len(episodes)), len(episodes), settings.window_steps
    student.train()
    for begin in range(0, count, settings.sequences):
        for group in optimizer.param_groups:
            group["lr"] = settings.rate((epoch + begin / count) / settings.epochs)
        chosen = [episodes[int(number)] for number in order[begin : begin + settings.sequences]]
        batch = sorted(chosen, key=len, reverse=True)  # the shorter ones leave it first
        state = student.start(len(batch))
        for first in range(0, len(batch[0]), window):
            running = [episode for episode in batch if len(episode) > first]
            seen, proprio, actions, seat = (
                pad_sequence([getattr(episode, part)[first : first + window] for episode in running], batch_first=True)
                for part in ("seen", "proprio", "actions", "seat")
            )
            steps = torch.tensor([len(episode) - first for episode in running])
            output = student.follow(seen, proprio, state[: len(running)])
            state = output.state.detach()
            there = torch.arange(seen.shape[1]) < steps[:, None]
            losses = _losses(output, actions, seat, there)
            weights = {"commands": 1.0, "sit": settings.sit_weight, "seat": settings.seat_weight}
            optimizer.zero_grad()
            torch.stack([weights[name] * loss for name, loss in losses.items()]).sum().backward()
            torch.nn.utils.clip_grad_norm_(student.parameters(), _MOST_GRADIENT)
            optimizer.step()
            yield min(begin + settings.sequences, count), {name: float(loss.detach()) for name, loss in losses.items()}


def _losses(output: Output, actions: torch.Tensor, seat: torch.Tensor, there: torch.Tensor) -> dict[str, torch.Tensor]:
    """Of the commands, of sitting and of the seat's pose, means over the frames that are ``there`` (B, T)."""
    wanted, targets = actions[there], seat[there]
    commands = -(two_hot(wanted[:, :3]) * output.levels[there].log_softmax(dim=-1)).sum(dim=-1).mean()
    sit = functional.binary_cross_entropy_with_logits(output.sit[there], (wanted[:, 3] > 0.0).float())
    everywhere = torch.ones(len(targets), dtype=torch.bool)
    return {"commands": commands, "sit": sit, "seat": seat_loss(output.seat[there], targets, everywhere)}
