"""What a data set tells of itself: the record that each file in ``sets`` has as ``DATASET``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ...captures.poses.photographs import Photograph
from ...core.progress import Progress


@dataclass(frozen=True)
class Split:
    """The photographs of a scene that are captures, in their order, and those that are held out, in metres.

    ``protocol`` says in a sentence by which rule, and whose. ``depth`` is what a real sensor measured of captures,
    by their names: maps of whole millimetres, of which nothing beyond ``range_m`` is believed. A model's own depth is
    ground truth and is never here.
    """

    captures: Sequence[Photograph]
    frozen: Sequence[Photograph]
    protocol: str
    depth: Mapping[str, Path] = field(default_factory=dict)
    range_m: float = 0.0


@dataclass(frozen=True)
class PublishedScore:
    """What somebody else reports of a method: PSNR in dB, and SSIM."""

    method: str
    psnr: float
    ssim: float


@dataclass(frozen=True)
class Published:
    """Figures of others, ``of`` what they are means, and their ``source``; ``captures`` is the count that they had."""

    of: str
    captures: int
    source: str
    scores: Sequence[PublishedScore]


@dataclass(frozen=True)
class Dataset:
    """One data set.

    ``name`` is what commands call it, ``about`` its layouts in a few words, ``captures`` how many photographs a scene
    is made of unless it is said. ``scenes`` finds the scenes in a folder by their names in tables, and raises nothing;
    ``split`` is given a scene's place and name and the count of captures, and raises ExperimentError or CaptureError.
    ``published`` stands below the tables.
    """

    name: str
    about: str
    captures: int
    scenes: Callable[[Path], Mapping[str, Path]]
    split: Callable[[Path, str, int, Progress], Split]
    published: Published | None = None
