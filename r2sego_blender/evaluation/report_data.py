"""What the report says, as plain data: whoever fills it needs to know nothing of HTML.

All texts are plain text; the template escapes them. A ``Picture`` is an image in memory,
(H, W, 3) float [0, 1] or uint8, or a file; None leaves its place empty.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

Picture = np.ndarray | Path | None


@dataclass(frozen=True)
class Arm:
    """One asset that was scored on the frozen views.

    ``key`` is its name in metrics.json, ``label`` what a person reads, ``note`` how it was
    made. A score that could not be computed is None; ``psnr_seen`` and ``psnr_unseen`` are of the
    pixels that captures saw and of the others, ``psnr_corrected`` where captures differ in exposure.
    """

    key: str
    label: str
    psnr: float | None
    ssim: float | None
    lpips_alex: float | None = None
    note: str = ""
    psnr_seen: float | None = None
    psnr_unseen: float | None = None
    psnr_corrected: float | None = None


@dataclass(frozen=True)
class Backend:
    """What filled one of the paper's slots; ``learned`` is whether that is a learned model."""

    slot: str
    backend: str
    learned: bool
    paper: str = ""


@dataclass(frozen=True)
class Rendering:
    """One arm's picture of a frozen view, and its scores there; ``arm`` is the arm's key."""

    arm: str
    picture: Picture
    psnr: float | None = None
    ssim: float | None = None
    psnr_seen: float | None = None
    psnr_unseen: float | None = None


@dataclass(frozen=True)
class FrozenView:
    """A held-out view: the photograph, and what each arm renders there.

    ``unseen`` is (H, W) bool, the pixels that no capture saw, or their picture, to be laid over the others.
    """

    name: str
    truth: Picture
    renderings: tuple[Rendering, ...]
    unseen: Picture = None


@dataclass(frozen=True)
class ScoredRound:
    """A round's asset on the frozen views.

    ``mark`` says in words that it scores below the one before; ``missing`` why it has no
    scores.
    """

    number: int
    psnr: float | None
    ssim: float | None
    mark: str = ""
    missing: str = ""


@dataclass(frozen=True)
class ErrorCause:
    """One cause of the refined asset's error.

    ``error`` and ``pixels`` are its shares, in [0, 1], of the squared error and of all
    pixels, ``psnr`` that of its pixels; all None where the cause cannot be told. ``colour``
    is sRGB in [0, 1].
    """

    label: str
    meaning: str
    mended_by: str
    colour: tuple[float, float, float]
    error: float | None = None
    pixels: float | None = None
    psnr: float | None = None


@dataclass(frozen=True)
class CausesOfView:
    """A frozen view coloured by cause; ``summary`` names the largest causes there."""

    name: str
    truth: Picture
    rendering: Picture
    coloured: Picture
    psnr: float | None = None
    summary: str = ""


@dataclass(frozen=True)
class ErrorSplit:
    """The refined asset's squared error on the frozen views, split by cause.

    ``told_by`` is by what the causes were told; ``note`` is said beside the table;
    ``unavailable`` says why there is no split at all.
    """

    told_by: str = ""
    causes: tuple[ErrorCause, ...] = ()
    worst: tuple[CausesOfView, ...] = ()
    note: str = ""
    unavailable: str = ""


@dataclass(frozen=True)
class RolloutSummary:
    """One attempted rollout; ``reason`` says why it succeeded or failed."""

    seed: int
    success: bool
    reason: str
    duration_s: float | None = None


@dataclass(frozen=True)
class CandidateCurves:
    """The scores of a round's candidate stream, in stream order.

    ``deficit`` u, ``availability`` g and ``score`` s are (M,) in [0, 1]; ``rollout`` (M,)
    names each candidate's rollout; ``chosen`` are indices of the target views.
    """

    deficit: np.ndarray
    availability: np.ndarray
    score: np.ndarray
    rollout: np.ndarray
    chosen: np.ndarray


@dataclass(frozen=True)
class Target:
    """One target view and what became of it.

    ``generated`` is the frame that was kept of the clip; ``offset_m`` and ``turn_deg`` are
    between the query pose and the pose that registration found; ``verdict`` says in words
    why the frame was kept or rejected. Of one that was trained on ``effect`` says what the round's update
    made of it, and ``removed`` is the share of the frozen views' squared error that it took away.
    """

    name: str
    accepted: bool
    verdict: str
    reference_name: str = ""
    reference: Picture = None
    condition: Picture = None
    generated: Picture = None
    score: float | None = None
    inliers: int | None = None
    offset_m: float | None = None
    turn_deg: float | None = None
    effect: str = ""
    removed: float | None = None


@dataclass(frozen=True)
class Round:
    """One pass of Algorithm 1, ``number`` from 0; pictures are plans from above."""

    number: int
    rollouts: tuple[RolloutSummary, ...] = ()
    candidates: CandidateCurves | None = None
    targets: tuple[Target, ...] = ()
    proxy_picture: Picture = None
    camera_map: Picture = None
    note: str = ""


@dataclass(frozen=True)
class Collision:
    """The published collision surface."""

    triangles: int
    convex_pieces: int


@dataclass(frozen=True)
class SettingUsed:
    """A setting of the run; ``changed`` when it is not the default."""

    key: str
    value: str
    default: str
    doc: str = ""

    @property
    def changed(self) -> bool:
        """Whether the value differs from the default."""
        return self.value != self.default


@dataclass(frozen=True)
class ReportData:
    """Everything the report shows, from the top of the page to its end.

    ``facts`` are (label, value) pairs for the head of the page, such as the seed. ``arms``
    in the order of the table; the last, refined, is the headline, and ``baseline`` is the key of
    the arm it is compared with, the strongest of others. ``scored_rounds`` are in order;
    ``error_split`` is None where nothing was scored. ``generator`` says how its own frames score,
    ``influence`` what its views did, ``unseen_told`` what share of the pixels no capture saw, ``geometry`` lines of
    its errors. ``provenance`` are the proxy's shares, {"observed": 0.6, ...}. ``timings`` are (step, seconds) in the
    order they ran.
    """

    title: str
    about: str = ""
    facts: tuple[tuple[str, str], ...] = ()
    arms: tuple[Arm, ...] = ()
    baseline: str = "vanilla_3dgs"
    lpips_reason: str = ""
    generator: str = ""
    influence: str = ""
    unseen_told: str = ""
    geometry: tuple[str, ...] = ()
    backends: tuple[Backend, ...] = ()
    scored_rounds: tuple[ScoredRound, ...] = ()
    error_split: ErrorSplit | None = None
    frozen: tuple[FrozenView, ...] = ()
    rounds: tuple[Round, ...] = ()
    provenance: dict[str, float] = field(default_factory=dict)
    collision: Collision | None = None
    settings: tuple[SettingUsed, ...] = ()
    timings: tuple[tuple[str, float], ...] = ()
