"""Which candidate views to generate: Eq. 2 of the paper, as a function of their scores.

A candidate's score is ``s = u * g``: the asset deficit ``u`` times the geometry
availability ``g``. Temporal non-maximum suppression collapses each run of near-identical
candidates into one keyframe, and the Top-K keyframes become the round's target views.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from ..bundle.artifacts import Artifact
from ..config.settings import SelectionSettings
from ..core.arrays import opened_arrays, require_between, require_shapes, save_arrays
from ..core.cameras import Camera, is_rigid
from ..core.errors import GenerationError
from ..core.json_files import opened_json, write_json
from ..core.printable import printable
from ..core.progress import SILENT, Progress
from .photographs import PhotographToTake

Reorder = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, Mapping[int, float]]]
"""Candidates (R,), best first by scores (M,), in another order; of some the share of what they miss that is left."""

_ARRAYS = (
    "rollout",
    "frame",
    "deficit",
    "availability",
    "score",
    "marginal",
    "survived",
    "rank",
    "chosen",
    "reference",
    "overlaps",
)


_MOST = 1.0 + 1e-6
"""Of a share, as sums of pixels' round."""


_MOST_VIEWS = 1_000_000
_MOST_PHOTOGRAPHS = 100


@dataclass(frozen=True)
class Selection:
    """What became of every candidate of a round, and why.

    All arrays are (M,), one entry a candidate: ``rollout`` and ``frame`` int64 name it;
    ``deficit`` (u), ``availability`` (g) and ``score`` (s) are float64 in [0, 1], and so is ``marginal``,
    the share of what it misses that no one ranked before it shows, 1 where that was not asked;
    ``survived`` bool says whether it is a temporal local maximum; ``rank`` int64 counts the
    eligible survivors from the best, 0, and is -1 elsewhere; ``chosen`` bool marks the
    target views. ``reference`` int64 is the capture i(v), and ``overlaps`` (M, N) float64
    what of the view each of the N captures sees; -1 and 0 where they were not asked for.
    ``reason`` says it in words; ``budget`` is K; ``note`` is empty, or says why fewer than
    K target views were chosen, or others than the best; ``ablations`` names the settings that
    leave a part of the method out. ``photographs`` are those that a person had better take next,
    best first.
    """

    rollout: np.ndarray
    frame: np.ndarray
    deficit: np.ndarray
    availability: np.ndarray
    score: np.ndarray
    marginal: np.ndarray
    survived: np.ndarray
    rank: np.ndarray
    chosen: np.ndarray
    reference: np.ndarray
    overlaps: np.ndarray
    reason: tuple[str, ...]
    budget: int
    note: str
    ablations: tuple[str, ...] = ()
    photographs: tuple[PhotographToTake, ...] = ()

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
            "budget": self.budget,
            "note": self.note,
            "ablations": list(self.ablations),
            "candidates": len(self.score),
            "survived": int(self.survived.sum()),
            "targets": [self.described(index) for index in self.targets],
            "reasons": list(self.reason),
        }
        if self.photographs:
            words["photographs"] = [one.to_json() for one in self.photographs]
        write_json(folder / "selection.json", words)

    @staticmethod
    def load(folder: Path) -> Selection:
        """Read what ``save`` wrote. Raises GenerationError when the files are damaged."""
        what = "this is not a selection of target views"
        with opened_json(folder / "selection.json", GenerationError, what) as words:
            *reason, note = _shown([*words["reasons"], words["note"]])
            ablations = _shown(words["ablations"])
            photographs = tuple(map(PhotographToTake.from_json, words.get("photographs", [])[:_MOST_PHOTOGRAPHS]))
            budget = int(words["budget"])
            if not 0 <= budget <= _MOST_VIEWS:
                raise ValueError(f"a budget of {budget}")
        with opened_arrays(folder / "selection.npz", GenerationError, what) as data:
            arrays = {name: data[name] for name in _ARRAYS if name in data or name != "marginal"}
            arrays.setdefault("marginal", np.ones(len(arrays["score"])))  # of bundles made before there was any
            require_shapes(arrays, **dict.fromkeys(_ARRAYS, "M") | {"overlaps": "M N"})
            _require_kinds(arrays)
            _require_ranks(arrays)
        if {array.shape[:1] for array in arrays.values()} != {(len(reason),)}:
            raise GenerationError(
                "selection.npz and selection.json do not belong together",
                where=folder,
                cure="Run `r2sego refine` again.",
            )
        return Selection(
            **arrays, reason=tuple(reason), budget=budget, note=note, ablations=ablations, photographs=photographs
        )

    def described(self, index: int) -> dict[str, object]:
        """A candidate's entries, JSON-ready."""
        return {
            "candidate": int(index),
            "rollout": int(self.rollout[index]),
            "frame": int(self.frame[index]),
            "deficit": float(self.deficit[index]),
            "availability": float(self.availability[index]),
            "score": float(self.score[index]),
            "marginal": float(self.marginal[index]),
            "rank": int(self.rank[index]),
            "chosen": bool(self.chosen[index]),
            "reference": int(self.reference[index]),
            "overlaps": self.overlaps[index].tolist(),
            "reason": self.reason[index],
        }


def _shown(texts: Sequence[str]) -> tuple[str, ...]:
    """The texts as a terminal may show them. Raises TypeError for what is no text."""
    return tuple(texts) if "".join(texts).isprintable() else tuple(map(printable, texts))


def _require_kinds(arrays: dict[str, np.ndarray]) -> None:
    """Raises ValueError where whole numbers and yes or no are others, or scores not from 0 to 1."""
    kinds = dict.fromkeys(("rollout", "frame", "rank", "reference"), "i") | dict.fromkeys(("survived", "chosen"), "b")
    for name, kind in kinds.items():
        if arrays[name].dtype.kind != kind:
            raise ValueError(f"{name} is {arrays[name].dtype}")
    require_between(0, None, rollout=arrays["rollout"], frame=arrays["frame"])
    require_between(
        0.0, _MOST, **{name: arrays[name] for name in ("deficit", "availability", "score", "marginal", "overlaps")}
    )


def _require_ranks(arrays: dict[str, np.ndarray]) -> None:
    """Raises ValueError where the ranks do not count from 0, the chosen are not the best of them, or
    references were given to others than the best, or to a capture beyond the last."""
    rank, chosen, reference = arrays["rank"], arrays["chosen"], arrays["reference"]
    eligible = rank >= 0
    if rank.min(initial=-1) < -1 or (np.sort(rank[eligible]) != np.arange(eligible.sum())).any():
        raise ValueError("rank")
    if (chosen != (eligible & (rank < chosen.sum()))).any():
        raise ValueError("chosen")
    referred = reference >= 0
    if (referred != (eligible & (rank < referred.sum()))).any() or reference.min(initial=-1) < -1:
        raise ValueError("reference")
    captures = arrays["overlaps"].shape[1]
    if reference.max(initial=-1) >= captures or (captures and referred.sum() < chosen.sum()):
        raise ValueError("reference")


def save_candidates(folder: Path, cameras: Sequence[Camera]) -> None:
    """Write a round's candidate views, which share one lens: ``candidates.npz`` (poses
    (M, 4, 4) float64 ``world_from_camera``) and ``candidates.json`` (the lens)."""
    if not cameras:
        raise GenerationError(
            "there are no candidate views",
            where=folder,
            cure="Run more rollouts, or let views turn faster (episode.max_turn_deg_s, 0 for any).",
        )
    save_arrays(folder / "candidates.npz", poses=np.stack([camera.world_from_camera for camera in cameras]))
    lens = {key: value for key, value in cameras[0].to_json().items() if key != "world_from_camera"}
    write_json(folder / "candidates.json", {"camera": lens})


def load_candidates(folder: Path) -> list[Camera]:
    """Read what ``save_candidates`` wrote. Raises GenerationError when the files are damaged."""
    camera, poses = load_candidate_poses(folder)
    return [camera.at(pose) for pose in poses]


def load_candidate_poses(folder: Path) -> tuple[Camera, np.ndarray]:
    """The lens that all candidates share, at the identity, and their poses (M, 4, 4) float64.

    Raises GenerationError when the files are damaged.
    """
    what = "these are not candidate views"
    with opened_json(folder / "candidates.json", GenerationError, what) as words:
        camera = Camera.from_json({**words["camera"], "world_from_camera": np.eye(4).tolist()})
    with opened_arrays(folder / "candidates.npz", GenerationError, what) as data:
        poses = data["poses"]
        require_shapes({"poses": poses}, poses="M 4 4")
        poses = poses.astype(np.float64)
        if not len(poses) or not is_rigid(poses):
            raise ValueError("a pose is not a rotation and a translation")
        return camera, poses


def temporal_nms(priority: np.ndarray, rollout: np.ndarray, frame: np.ndarray, window: int) -> np.ndarray:
    """(M,) int64: the candidate that suppresses each one, or its own index if it survives.

    A temporal local maximum is a candidate whose priority no other of its rollout, half a
    ``window`` to either side, exceeds; of equal ones the earliest is, so that a run of them
    keeps its first frame alone. A rollout's maxima survive from the best on, but for those
    at most ``window`` frames from one that has survived. The suppressor named is the best
    there is within reach.
    """
    suppressor = np.arange(len(priority))
    stream = np.lexsort((frame, rollout))
    bounds = np.flatnonzero(np.diff(rollout[stream])) + 1
    for members in np.split(stream, bounds):
        times = frame[members]
        first = np.searchsorted(times, times - window // 2, side="left")
        last = np.searchsorted(times, times + window // 2, side="right")
        for position, (start, stop) in enumerate(zip(first, last, strict=True)):
            # argmax takes the first of equals, and members are in temporal order
            suppressor[members[position]] = members[start + np.argmax(priority[members[start:stop]])]
        maxima = members[suppressor[members] == members]
        kept: list[int] = []
        for index in maxima[np.argsort(-priority[maxima], kind="stable")]:
            near = (other for other in kept if abs(frame[other] - frame[index]) <= window)
            suppressor[index] = next(near, index)
            if suppressor[index] == index:
                kept.append(index)
    return suppressor


def select_targets(
    deficit: np.ndarray,
    availability: np.ndarray,
    rollout: np.ndarray,
    frame: np.ndarray,
    settings: SelectionSettings,
    progress: Progress = SILENT,
    rng: np.random.Generator | None = None,
    refused: Mapping[int, str] = MappingProxyType({}),
    reorder: Reorder | None = None,
) -> Selection:
    """Eq. 2: score, temporal non-maximum suppression and Top-K; all inputs are (M,).

    A survivor is eligible when its score is above zero; equal scores rank by rollout and
    frame. The ``refused`` candidates, each with its reason, are left out before suppression.
    When fewer than K are eligible, all of them are chosen and ``note`` says so.
    ``reorder`` ranks the eligible anew, by what each adds to those before it.
    The candidates may come in any order. With ``settings.ranking`` "random" a number that
    ``rng`` draws for each candidate stands in for the score, and all survivors are eligible.
    Raises ValueError for candidates named twice or scores that are not finite.
    """
    deficit, availability = np.asarray(deficit, np.float64), np.asarray(availability, np.float64)
    rollout, frame = np.asarray(rollout, np.int64), np.asarray(frame, np.int64)
    if not deficit.shape == availability.shape == rollout.shape == frame.shape:
        raise ValueError("deficit, availability, rollout and frame must have one shape (M,)")
    score = deficit * availability
    if not np.isfinite(score).all():
        raise ValueError("scores must be finite")
    stream = np.lexsort((frame, rollout))
    if len(np.unique(np.stack([rollout, frame]), axis=1).T) < len(score):
        raise ValueError("a rollout's frame must stand once among the candidates")
    at_random = settings.ranking == "random"
    priority = _drawn(stream, rng) if at_random else score
    out = np.zeros(len(score), bool)
    out[list(refused)] = True
    suppressor = np.arange(len(score))
    left = np.flatnonzero(~out)
    suppressor[left] = left[temporal_nms(priority[left], rollout[left], frame[left], settings.nms_window)]
    survived = ~out & (suppressor == np.arange(len(score)))
    eligible = survived & (at_random | (score > 0.0))
    order = stream[np.argsort(-priority[stream], kind="stable")]
    order = order[eligible[order]]
    marginal = np.ones(len(score))
    if reorder is not None:
        order, left_of = reorder(order, score)
        marginal[[*left_of]] = [*left_of.values()]
    rank = np.full(len(score), -1, np.int64)
    rank[order] = np.arange(len(order))
    chosen = (rank >= 0) & (rank < settings.target_views)
    note = ""
    if len(order) < settings.target_views:
        note = (
            f"{len(order)} target views instead of {settings.target_views}: of {len(score)} candidates, "
            f"{int(survived.sum())} survive temporal suppression"
        )
        note += "" if at_random else f" and {len(order)} of these score above zero"
        progress.message(note, level="warning")
    reason = tuple(
        f"refused: {refused[index]}"
        if index in refused
        else _reason(index, deficit, availability, priority, suppressor, frame, rank, settings, marginal)
        for index in range(len(score))
    )
    return Selection(
        rollout,
        frame,
        deficit,
        availability,
        score,
        marginal,
        survived,
        rank,
        chosen,
        reference=np.full(len(score), -1, np.int64),
        overlaps=np.zeros((len(score), 0)),
        reason=reason,
        budget=settings.target_views,
        note=note,
        ablations=ablations(settings),
    )


def ablations(settings: SelectionSettings) -> tuple[str, ...]:
    """The settings that leave a part of the method out, as ``key = value``."""
    whole = SelectionSettings()
    keys = ("candidates", "ranking", "geometry")
    return tuple(
        f"selection.{key} = {getattr(settings, key)}" for key in keys if getattr(settings, key) != getattr(whole, key)
    )


def _drawn(stream: np.ndarray, rng: np.random.Generator | None) -> np.ndarray:
    """(M,) a random priority for each candidate, which does not depend on their order."""
    if rng is None:
        raise ValueError("a random ranking needs a random generator")
    priority = np.empty(len(stream))
    priority[stream] = rng.random(len(stream))
    return priority


def _reason(
    index: int,
    deficit: np.ndarray,
    availability: np.ndarray,
    priority: np.ndarray,
    suppressor: np.ndarray,
    frame: np.ndarray,
    rank: np.ndarray,
    settings: SelectionSettings,
    marginal: np.ndarray,
) -> str:
    better, budget, at_random = suppressor[index], settings.target_views, settings.ranking == "random"
    if better != index and at_random:
        return f"passed over: frame {frame[better]} of this rollout was drawn before"
    if better != index:
        relation = "scores higher" if priority[better] > priority[index] else "scores the same, earlier"
        return f"suppressed: frame {frame[better]} of this rollout {relation}"
    shares = f"{deficit[index]:.0%} of the pixels missing, {availability[index]:.0%} available"
    shown = 1.0 - marginal[index]
    shares += f", targets before it show {shown:.0%} of what is missing" if shown else ""
    place = rank[index] + 1
    if at_random:
        if place <= budget:
            return f"drawn at random, number {place} of {budget}: {shares}"
        return f"not drawn: number {place} is beyond the budget of {budget}; {shares}"
    if deficit[index] == 0.0:
        return "not eligible: the asset renders every pixel"
    if availability[index] == 0.0:
        return "not eligible: the proxy renders no pixel"
    if place <= budget:
        return f"chosen, rank {place} of {budget}: {shares}"
    return f"not chosen: rank {place} is beyond the budget of {budget}; {shares}"


class SelectedViews(NamedTuple):
    """The target views of a round, and the candidates (M) that they are chosen from."""

    selection: Selection
    candidates: list[Camera]

    @staticmethod
    def load(folder: Path) -> SelectedViews:
        """Read what ``save`` wrote. Raises GenerationError for files that do not go together."""
        selected = SelectedViews(Selection.load(folder), load_candidates(folder))
        if len(selected.selection.score) != len(selected.candidates):
            raise selected._mismatch(folder, selected.selection.overlaps.shape[1])
        return selected

    def save(self, folder: Path) -> None:
        """Write the selection and the candidates into ``folder``."""
        self.selection.save(folder)
        save_candidates(folder, self.candidates)

    def require_captures(self, count: int) -> SelectedViews:
        """These. Raises GenerationError where their references are not among ``count`` captures."""
        if self.selection.overlaps.shape[1] not in (0, count):
            raise self._mismatch(Path(SELECTION.name), count)
        return self

    def _mismatch(self, folder: Path, captures: int) -> GenerationError:
        known = self.selection.overlaps.shape[1]
        return GenerationError(
            f"it is of {len(self.selection.score)} candidates and {known} captures, and there are "
            f"{len(self.candidates)} and {captures}",
            where=folder / "selection.npz",
            cure="Run `r2sego refine` again.",
        )


SELECTION = Artifact("selection", SelectedViews.load, SelectedViews.save)
"""A round's: ``SELECTION.of_round(l)``."""

CHOICE = Artifact("selection", Selection.load)
"""What became of a round's candidates, without their cameras."""

CANDIDATE_POSES = Artifact("selection", load_candidate_poses)
"""Where a round's candidates look from."""

CANDIDATES = Artifact("selection", load_candidates)
"""The cameras of a round's candidates."""
