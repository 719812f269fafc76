"""The eye learns where it is: single pictures, and the pose of the base and the seat that belong to them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import torch
from torch.nn import functional

from ..student.network import PLACE_M, Student
from .episodes import Episode
from .losses import SMALL, seat_loss
from .settings import DaggerSettings

_WARM_UP_UPDATES = 100


def localize(
    student: Student,
    optimizer: torch.optim.Adam,
    episodes: Sequence[Episode],
    settings: DaggerSettings,
    epoch: int,
    rates: tuple[float, float],
) -> Iterator[tuple[int, dict[str, float]]]:
    """One pass of all pictures: after each update, how many are done, its loss and how far off it is.

    The order comes of the settings' seed and the epoch alone; the learning rate goes from the first of ``rates``,
    shares of the settings', to the second.
    """
    rng = np.random.default_rng([settings.seed, epoch, 0xE7E])
    steps = np.array([(number, step) for number, episode in enumerate(episodes) for step in range(len(episode))])
    updates = math.ceil(len(steps) / settings.pictures)
    student.train()
    for update, batch in enumerate(np.array_split(rng.permutation(steps), updates)):
        warm = min(1.0, (1 + update + epoch * updates) / _WARM_UP_UPDATES)
        share = rates[0] + (rates[1] - rates[0]) * update / updates
        for group in optimizer.param_groups:
            group["lr"] = settings.learning_rate * warm * share
        pictures, base_poses, seat = (
            torch.from_numpy(np.stack([getattr(episodes[number], part)[step] for number, step in batch]))
            for part in ("pictures", "base_poses", "seat")
        )
        said = student.localizer(student.see(pictures))
        place = (base_poses[:, :2] - student.place_mean) / PLACE_M
        heading = torch.stack([base_poses[:, 2].cos(), base_poses[:, 2].sin()], dim=1)
        pose = functional.smooth_l1_loss(said[:, :4], torch.cat([place, heading], dim=1), beta=SMALL)
        # What is out of view is known of the room's own seats alone, by where one stands.
        loss = pose + settings.seat_weight * seat_loss(said[:, 4:], seat, seat[:, 5] > 0.5)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        with torch.no_grad():
            place_m = PLACE_M * (said[:, :2] - place).norm(dim=1).mean()
            turned = (said[:, 2:4] * heading).sum(dim=1) / said[:, 2:4].norm(dim=1).clamp_min(1e-6)
            heading_deg = torch.rad2deg(turned.clamp(-1.0, 1.0).acos()).mean()
        figures = {"pose": float(pose.detach()), "place_m": float(place_m), "heading_deg": float(heading_deg)}
        yield int(min((update + 1) * settings.pictures, len(steps))), figures
