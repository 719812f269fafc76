"""A policy's recorded evaluation: whose it is and what came of it, beside its episodes. No bpy.

Its folder has the episodes as a trial's has its attempts (``robot.rollouts``: rollouts, and the robot's bodies along
them), ``evaluation.json``, and for some episodes what the head saw: ``head/0003/000.png``, a picture a frame.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..bundle.artifacts import Artifact
from ..core.errors import SceneError
from ..core.json_files import opened_json, write_json
from .panels.bundle import Bundle
from .panels.rollout_list import POLICY, rollouts_folder

FILE = "evaluation.json"
EMBEDDED_DRIVE = "the embedded assisted controller"
"""What drives the robot's joints as a policy commands, with a force that helps its base."""

MOST_EPISODES = 200
"""Recorded at once: the bodies of one are up to 1.5 MB."""

_CURE = "Evaluate the policy again."


@dataclass(frozen=True)
class PolicyEvaluation:
    """What a policy was, and how its episodes ended.

    ``policy`` is a training's folder or "teacher"; ``driver`` names what carried its actions out; ``asset`` the splats
    that stood in for the scene's own, '' for these; ``reference`` the folder of the reference room that episodes
    were taken to, '' for the scene; ``chairs`` the kinds that stood in the room. ``low`` and ``high``
    are the exact 95 % interval of the rate, ``failures`` the number of each kind, ``mean_assist_n`` the mean helping
    force over the episodes.
    """

    policy: str
    driver: str
    asset: str
    reference: str
    chairs: tuple[str, ...]
    successes: int
    episodes: int
    low: float
    high: float
    failures: dict[str, int]
    mean_assist_n: float

    def save(self, folder: Path) -> None:
        """Write it as ``evaluation.json``."""
        write_json(folder / FILE, dataclasses.asdict(self))

    @staticmethod
    def load(folder: Path) -> PolicyEvaluation:
        """Read it. Raises SceneError where it is not there whole, or its numbers do not fit together."""
        with opened_json(folder / FILE, SceneError, "this evaluation cannot be read", _CURE) as told:
            read = PolicyEvaluation(
                _text(told["policy"]),
                _text(told["driver"]),
                _text(told["asset"]),
                _text(told["reference"]),
                tuple(map(_text, told["chairs"])),
                _count(told["successes"]),
                _count(told["episodes"]),
                float(told["low"]),
                float(told["high"]),
                {_text(kind): _count(number) for kind, number in told["failures"].items()},
                float(told["mean_assist_n"]),
            )
            if read.successes + sum(read.failures.values()) != read.episodes or not read.episodes:
                raise ValueError("its counts are not those of its episodes")
            rate, within_float = read.successes / read.episodes, 1e-9
            if not 0.0 <= read.low <= rate + within_float <= read.high + 2.0 * within_float <= 1.0 + 3.0 * within_float:
                raise ValueError("its interval is none of its rate")
            if not (math.isfinite(read.mean_assist_n) and read.mean_assist_n >= 0.0):
                raise ValueError("its helping force is none")
        return read

    def require_of(self, ends: Iterable[str]) -> None:
        """Raises SceneError where it is not of episodes that ended so, '' for successes."""
        if Counter(ends) != Counter({end: number for end, number in self.by_end.items() if number}):
            raise SceneError("this evaluation is of other episodes", where=FILE, cure=_CURE)

    @property
    def policy_name(self) -> str:
        """The policy without the folders around its own."""
        return re.split(r"[/\\]", self.policy.rstrip("/\\"))[-1]

    @property
    def by_end(self) -> dict[str, int]:
        """Episodes by how they ended: '' for success first, then the kinds of failure, each in its place by name."""
        return {"": self.successes, **dict(sorted(self.failures.items()))}


POLICY_EVALUATION = Artifact("robot/policy", PolicyEvaluation.load)
"""The recorded evaluation of a bundle."""


def is_recorded(bundle: Bundle) -> bool:
    """Whether a bundle has a policy's recorded evaluation."""
    return (rollouts_folder(bundle, POLICY) / FILE).is_file()


def head_pictures(bundle: Bundle, number: int, frames: int) -> list[Path]:
    """What the head saw in an episode of so many frames, a file a frame; none where it was not kept.

    Raises SceneError where frames are missing.
    """
    folder = head_folder(rollouts_folder(bundle, POLICY), number)
    files = [folder / picture_name(frame) for frame in range(frames)]
    if not folder.is_dir():
        return []
    missing = next((file for file in files if not file.is_file()), None)
    if missing is not None:
        raise SceneError("what the head saw is not there whole", where=missing, cure=_CURE)
    return files


def head_folder(folder: Path, number: int) -> Path:
    """Where the head's pictures of an episode stand in a recorded evaluation's ``folder``."""
    return folder / "head" / f"{number:04d}"


def picture_name(frame: int) -> str:
    """The file of a frame."""
    return f"{frame:03d}.png"


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return value


def _count(value: Any) -> int:
    if type(value) is not int or value < 0:
        raise ValueError(f"{value!r} is no count")
    return value
