"""Which candidate views to generate, and from which capture (the paper's Eq. 2).

A candidate's score is ``s = u * g``: the asset deficit ``u`` times the geometry
availability ``g``. Temporal non-maximum suppression collapses each run of near-identical
candidates into one keyframe, and the Top-K keyframes become the round's target views.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .arrays import opened_arrays, save_arrays
from .cameras import Camera
from .errors import GenerationError
from .progress import SILENT, Progress
from .settings import SelectionSettings

# Depth differences below a centimetre are the proxy's own roughness, at any distance.
_TOLERANCE_FLOOR_M = 0.01


@dataclass(frozen=True)
class Selection:
    """What became of every candidate of a round, and why.

    All arrays are (M,), one entry a candidate: ``rollout`` and ``frame`` int64 name it;
    ``deficit`` (u), ``availability`` (g) and ``score`` (s) are float64 in [0, 1];
    ``survived`` bool says whether it is a temporal local maximum; ``rank`` int64 counts the
    eligible survivors from the best, 0, and is -1 elsewhere; ``chosen`` bool marks the
    target views. ``reason`` says it in words; ``budget`` is K; ``note`` is empty, or says
    why fewer than K target views were chosen.
    """

    rollout: np.ndarray
    frame: np.ndarray
    deficit: np.ndarray
    availability: np.ndarray
    score: np.ndarray
    survived: np.ndarray
    rank: np.ndarray
    chosen: np.ndarray
    reason: tuple[str, ...]
    budget: int
    note: str

    @property
    def ranked(self) -> np.ndarray:
        """(R,) int64: the eligible survivors' candidate indices, best first."""
        eligible = np.flatnonzero(self.rank >= 0)
        return eligible[np.argsort(self.rank[eligible])]

    @property
    def targets(self) -> np.ndarray:
        """(<= K,) int64: the target views' candidate indices, best first."""
        return self.ranked[: int(self.chosen.sum())]

    def save(self, folder: Path) -> None:
        """Write ``selection.npz`` (all numbers) and ``selection.json`` (words and a summary)."""
        folder.mkdir(parents=True, exist_ok=True)
        save_arrays(folder / "selection.npz", **{name: getattr(self, name) for name in _ARRAYS})
        words = {
            "budget": self.budget, "note": self.note,
            "candidates": len(self.score), "survived": int(self.survived.sum()),
            "targets": [self._described(index) for index in self.targets],
            "reasons": list(self.reason),
        }  # fmt: skip
        (folder / "selection.json").write_text(json.dumps(words, indent=1) + "\n")

    @staticmethod
    def load(folder: Path) -> Selection:
        """Read what ``save`` wrote. Raises GenerationError when the files are damaged."""
        what = "this is not a selection of target views"
        with opened_arrays(folder / "selection.npz", GenerationError, what) as data:
            arrays = {name: data[name] for name in _ARRAYS}
            words = json.loads((folder / "selection.json").read_text())
            reason, budget, note = tuple(words["reasons"]), int(words["budget"]), str(words["note"])
        if {array.shape for array in arrays.values()} != {(len(reason),)}:
            raise GenerationError(
                "selection.npz and selection.json do not belong together",
                where=folder, cure="Run the round again.",
            )  # fmt: skip
        return Selection(**arrays, reason=reason, budget=budget, note=note)

    def _described(self, index: int) -> dict[str, object]:
        return {
            "candidate": int(index), "rollout": int(self.rollout[index]), "frame": int(self.frame[index]),
            "deficit": float(self.deficit[index]), "availability": float(self.availability[index]),
            "score": float(self.score[index]), "reason": self.reason[index],
        }  # fmt: skip


def save_candidates(folder: Path, cameras: Sequence[Camera]) -> None:
    """Write a round's candidate views, which share one lens: ``candidates.npz`` (poses
    (M, 4, 4) float64 ``world_from_camera``) and ``candidates.json`` (the lens)."""
    if not cameras:
        raise GenerationError("there are no candidate views", where=folder, cure="Run more rollouts.")
    save_arrays(folder / "candidates.npz", poses=np.stack([camera.world_from_camera for camera in cameras]))
    lens = {key: value for key, value in cameras[0].to_json().items() if key != "world_from_camera"}
    (folder / "candidates.json").write_text(json.dumps({"camera": lens}, indent=1) + "\n")


def load_candidates(folder: Path) -> list[Camera]:
    """Read what ``save_candidates`` wrote. Raises GenerationError when the files are damaged."""
    with opened_arrays(folder / "candidates.npz", GenerationError, "these are not candidate views") as data:
        lens = json.loads((folder / "candidates.json").read_text())["camera"]
        return [Camera.from_json({**lens, "world_from_camera": pose}) for pose in data["poses"]]


_ARRAYS = (
    "rollout", "frame", "deficit", "availability", "score", "survived", "rank", "chosen",
)  # fmt: skip


def support_scores(
    cameras: Sequence[Camera],
    alpha_of: Callable[[Camera], np.ndarray],
    validity_of: Callable[[Camera], np.ndarray],
    settings: SelectionSettings,
    progress: Progress = SILENT,
) -> tuple[np.ndarray, np.ndarray]:
    """Asset deficit u (M,) and geometry availability g (M,) of each camera, float64 in [0, 1].

    ``alpha_of`` renders the current asset's alpha (H, W) and ``validity_of`` the proxy's
    validity (H, W), both in [0, 1]; both are called at the settings' scoring scale. u is
    the share of pixels whose alpha is below its threshold, g the share whose validity
    reaches its own.
    """
    deficit, availability = np.empty(len(cameras)), np.empty(len(cameras))
    with progress.task("Scoring candidates", len(cameras)) as task:
        for index, camera in enumerate(cameras):
            small = camera.scaled(settings.scoring_scale)
            deficit[index] = np.mean(alpha_of(small) < settings.alpha_threshold)
            availability[index] = np.mean(validity_of(small) >= settings.validity_threshold)
            task.advance()
    return deficit, availability


def temporal_nms(score: np.ndarray, rollout: np.ndarray, frame: np.ndarray, window: int) -> np.ndarray:
    """(M,) int64: the candidate that suppresses each one, or its own index if it survives.

    A candidate survives when no other of its rollout within ``window`` frames, half to
    either side, scores higher, or equally high and earlier (in ``frame``, then in the
    stream). So a run of equal scores keeps its first frame alone. The suppressor named is
    the best candidate of the window.
    """
    suppressor = np.arange(len(score))
    reach = window // 2
    stream = np.lexsort((np.arange(len(score)), frame, rollout))
    bounds = np.flatnonzero(np.diff(rollout[stream])) + 1
    for members in np.split(stream, bounds):
        times = frame[members]
        first = np.searchsorted(times, times - reach, side="left")
        last = np.searchsorted(times, times + reach, side="right")
        for position, (start, stop) in enumerate(zip(first, last, strict=True)):
            # argmax takes the first of equals, and members are in temporal order
            suppressor[members[position]] = members[start + np.argmax(score[members[start:stop]])]
    return suppressor


def select_targets(
    deficit: np.ndarray,
    availability: np.ndarray,
    rollout: np.ndarray,
    frame: np.ndarray,
    settings: SelectionSettings,
    progress: Progress = SILENT,
) -> Selection:
    """Eq. 2: score, temporal non-maximum suppression and Top-K; all inputs are (M,).

    A survivor is eligible when its score is above zero; equal scores rank in the stream's
    order. When fewer than K are eligible, all of them are chosen and ``note`` says so.
    """
    deficit, availability = np.asarray(deficit, np.float64), np.asarray(availability, np.float64)
    rollout, frame = np.asarray(rollout, np.int64), np.asarray(frame, np.int64)
    if not deficit.shape == availability.shape == rollout.shape == frame.shape:
        raise ValueError("deficit, availability, rollout and frame must have one shape (M,)")
    score = deficit * availability
    if not np.isfinite(score).all():
        raise ValueError("scores must be finite")
    suppressor = temporal_nms(score, rollout, frame, settings.nms_window)
    survived = suppressor == np.arange(len(score))
    order = np.argsort(-score, kind="stable")
    order = order[(survived & (score > 0.0))[order]]
    rank = np.full(len(score), -1, np.int64)
    rank[order] = np.arange(len(order))
    chosen = (rank >= 0) & (rank < settings.target_views)
    note = ""
    if len(order) < settings.target_views:
        note = (
            f"{len(order)} target views instead of {settings.target_views}: of {len(score)} candidates, "
            f"{int(survived.sum())} survive temporal suppression and {len(order)} of these score above zero"
        )
        progress.message(note, level="warning")
    reason = tuple(
        _reason(index, deficit, availability, score, suppressor, frame, rank, settings.target_views)
        for index in range(len(score))
    )
    return Selection(
        rollout, frame, deficit, availability, score, survived, rank, chosen,
        reason, settings.target_views, note,
    )  # fmt: skip


def _reason(
    index: int, deficit: np.ndarray, availability: np.ndarray, score: np.ndarray,
    suppressor: np.ndarray, frame: np.ndarray, rank: np.ndarray, budget: int,
) -> str:  # fmt: skip
    better = suppressor[index]
    if better != index:
        relation = "scores higher" if score[better] > score[index] else "scores the same, earlier"
        return f"suppressed: frame {frame[better]} of this rollout {relation}"
    if deficit[index] == 0.0:
        return "not eligible: the asset renders every pixel"
    if availability[index] == 0.0:
        return "not eligible: the proxy renders no pixel"
    shares = f"{deficit[index]:.0%} of the pixels missing, {availability[index]:.0%} available"
    if rank[index] < budget:
        return f"chosen, rank {rank[index] + 1} of {budget}: {shares}"
    return f"not chosen: rank {rank[index] + 1} is beyond the budget of {budget}; {shares}"


def select_reference(
    target: Camera,
    captures: Sequence[Camera],
    depth_of: Callable[[Camera], np.ndarray],
    capture_depths: Sequence[np.ndarray],
    settings: SelectionSettings,
) -> tuple[int, np.ndarray]:
    """The target's reference capture i(v) and each capture's overlap (N,) in [0, 1].

    The overlap is the share of the proxy points visible at the target (one a pixel of
    ``depth_of`` at the scoring scale) that are also visible in the capture: inside its
    image and not occluded, tested against the proxy's depth there, ``capture_depths``
    (each (H, W) float32 m, at any resolution of the capture's view). The first of equals
    is taken. Raises GenerationError when there are no captures.
    """
    if not captures:
        raise GenerationError("there are no captures to refer to", cure="Import the photographs again.")
    small = target.scaled(settings.scoring_scale)
    depth = depth_of(small)
    points = small.unproject(depth)[depth > 0.0]
    overlaps = np.zeros(len(captures))
    if len(points):
        for index, (camera, capture_depth) in enumerate(zip(captures, capture_depths, strict=True)):
            overlaps[index] = _visible(points, camera, capture_depth, settings.overlap_tolerance).mean()
    return int(np.argmax(overlaps)), overlaps


def _visible(points: np.ndarray, camera: Camera, depth: np.ndarray, tolerance: float) -> np.ndarray:
    """(P,) bool: the world points (P, 3) that ``camera``, with its depth map, sees."""
    pixels, z = camera.project(points)
    visible = camera.sees(pixels, z)
    height, width = depth.shape
    columns = (pixels[visible, 0] * (width / camera.width)).astype(np.int64)
    rows = (pixels[visible, 1] * (height / camera.height)).astype(np.int64)
    seen = depth[np.minimum(rows, height - 1), np.minimum(columns, width - 1)]
    z = z[visible]
    visible[visible] = (seen > 0.0) & (z <= seen * (1.0 + tolerance) + _TOLERANCE_FLOOR_M)
    return visible
