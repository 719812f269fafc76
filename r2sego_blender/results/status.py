"""What a scene holds and how far its refinement has come."""

from __future__ import annotations

import contextlib
import itertools
import os
import shlex
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path, PureWindowsPath
from typing import Any

from ..bundle.damage import damaged_results
from ..bundle.figures import CAMERAS, COUNTS, METRICS, damaged
from ..bundle.layout import REFINED_ASSET
from ..bundle.scene import Scene
from ..bundle.stale import in_words, of_old_frame, rounds_among
from ..core.atomic_files import is_replacing
from ..core.errors import RobotError, SceneError
from ..robot.scope.scope import BehaviourScope

_COUNTS = {"rollouts_succeeded", "rollouts_failed", "candidates", "targets", "views_kept"}
"""What is told of each round."""


def describe(
    scene: Scene, look_at_results: bool = False, outdated: Sequence[str] = (), obstacle: str = ""
) -> dict[str, Any]:
    """The scene's state, JSON-ready: declaration, rounds done and what each left.

    With ``look_at_results`` they are read through, and ``damaged`` names those that are not as they
    were published. ``outdated`` are the parts that the next refinement makes again, ``obstacle`` is why it would
    not begin (``plan``).
    """
    declared = scene.declaration
    rounds = [_describe_round(scene, index) for index in _counted_rounds(scene)]
    rounds_declared = declared.settings.rounds
    old = of_old_frame(scene)
    old_in_words = in_words(old, rounds_declared)
    damaged = damaged_results(scene) if look_at_results else ()
    metrics = _scores(scene)
    half_corrected = is_replacing(scene.path)
    is_whole = scene.asset_file.is_file() and not (old_in_words or damaged or half_corrected)
    return {
        "scene": str(scene.path),
        "captures": len(scene.read(CAMERAS)["captures"]),
        "captures_source": declared.captures_source,
        "ground": declared.ground,
        "scale_source": declared.scale_source,
        "robot": robot_in_use(scene),
        "scope": declared.scope,
        "preset": declared.preset,
        "overrides": dict(declared.overrides),
        "backends": scene.backends,
        "rounds_declared": rounds_declared,
        "rounds": rounds,
        "rounds_of_old_frame": list(rounds_among(old, rounds_declared)),
        "of_old_frame": old_in_words,
        "damaged": list(damaged),
        "half_corrected": half_corrected,
        "outdated": list(outdated),
        "obstacle": obstacle,
        "refined": is_whole and len(rounds) >= rounds_declared and not outdated,
        "metrics": metrics,
        "metrics_outdated": metrics is not None and not scores_hold(scene),
    }


def lines(state: dict[str, Any]) -> list[str]:
    """The state as lines for a person."""
    text = [
        f"{state['scene']}: {state['captures']} captures from {state['captures_source']}",
        f"ground: {state['ground']}; scale: {state['scale_source']}",
        f"robot: {state['robot']}, scope: {state['scope']}, preset: {state['preset']}",
    ]
    text += [f"  {key} = {value}" for key, value in state["overrides"].items()]
    text.append(f"rounds: {len(state['rounds'])} of {state['rounds_declared']} done")
    text += [
        f"  round {index}: {r['rollouts_succeeded']} rollouts succeeded, {r['rollouts_failed']} failed; "
        f"{r['candidates']} candidates, {r['targets']} targets, {r['views_kept']} views kept"
        for index, r in enumerate(state["rounds"])
    ]
    if state["metrics_outdated"]:
        text.append("  scored before the asset changed: r2sego evaluate scores it anew")
    elif state["metrics"]:
        text += _told(state["metrics"])
    if state["of_old_frame"]:
        text.append(f"of the world frame before its correction: {state['of_old_frame']}")
    text += [f"not as it was made: {name}" for name in state["damaged"]]
    if state["half_corrected"]:
        text.append("a correction was cut off before all of it was in its place; refine finishes it first")
    if state["outdated"] and len(state["rounds"]) >= state["rounds_declared"]:
        text.append(f"what they are made of, or a setting, has changed: {', '.join(state['outdated'])}")
    if state["obstacle"]:
        text.append(f"the next refine would not begin: {state['obstacle']}")
    text.append("refined" if state["refined"] else f"next: r2sego refine {_quoted(state['scene'])}")
    return text


def scores_hold(scene: Scene) -> bool:
    """Whether the scene was evaluated and all assets that were scored are still those, by the journal."""
    try:
        assets = scene.read(METRICS).get("assets")
    except SceneError:
        return False
    scored, now = {REFINED_ASSET: None, **(assets if isinstance(assets, dict) else {})}, scene.outputs()
    return all(now.get(name) == digest for name, digest in scored.items())


def _quoted(word: str, system: str = os.name) -> str:
    """A word of a command as the system's shell takes it: Windows' knows no single quotes."""
    return subprocess.list2cmdline([word]) if system == "nt" else shlex.quote(word)


def robot_in_use(scene: Scene) -> str:
    """The scope's own robot, else the declared one; that too where the scope cannot be read, which is
    for refining to say."""
    declared = scene.declaration
    with contextlib.suppress(RobotError):
        own, _ = BehaviourScope.load(declared.scope).robot_for(declared.robot)
        return scene.name_of(own)
    return declared.robot


def without_folders(named: str) -> str:
    """A robot's or a scope's name as it is told to whom results are handed on: folders are the person's own affair."""
    path = PureWindowsPath(named)
    return path.name if path.is_absolute() or Path(named).is_absolute() else named


def _counted_rounds(scene: Scene) -> Iterator[int]:
    """The rounds whose last step is there: one may have been cut off between its asset and its counts."""
    return itertools.takewhile(
        lambda index: (scene.round_folder(index) / "metrics.json").is_file(), range(scene.rounds_of_result())
    )


def _describe_round(scene: Scene, index: int) -> dict[str, Any]:
    made = COUNTS.of_round(index)
    counts = scene.read(made)
    missing = _COUNTS - counts.keys()
    if missing:
        raise damaged(scene.path / made.name, f"'{min(missing)}' is missing")
    return counts


def _scores(scene: Scene) -> dict[str, Any] | None:
    """The scores that an evaluation left, looked over; None where there was none."""
    if not scene.metrics_file.is_file():
        return None
    metrics = scene.read(METRICS)
    try:
        _told(metrics)
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        cure = "Run `r2sego evaluate` again, or remove the file."
        raise damaged(scene.metrics_file, "a field of the scores is missing or wrong", cure) from error
    return metrics


def _told(metrics: dict[str, Any]) -> list[str]:
    """The scores as lines."""
    return [
        *(_scored(name, arm) for name, arm in sorted(metrics["arms"].items())),
        *(_scored_round(entry) for entry in metrics.get("rounds", ())),
        *_largest_cause(metrics.get("causes", {})),
    ]


def _scored_round(entry: dict[str, Any]) -> str:
    name = f"round {entry['round']}"
    if "missing" in entry:
        return f"  {name:<14} not scored: {entry['missing']}"
    return _scored(name, entry) + (f", {entry['mark']}" if "mark" in entry else "")


def _scored(name: str, scores: dict[str, Any]) -> str:
    """A line of scores; the PSNR of equal images is no number in the file."""
    psnr = float("inf") if scores["psnr"] is None else scores["psnr"]
    return f"  {name:<14} PSNR {psnr:.2f} dB, SSIM {scores['ssim']:.3f}"


def _largest_cause(causes: dict[str, Any]) -> list[str]:
    """A line that names the largest cause of the refined asset's error, where causes were told."""
    told = [one for one in causes.get("shares", ()) if one["error"]]
    if not told:
        return []
    largest = max(told, key=lambda one: one["error"])
    return [f"  largest cause of error: {largest['label']}, {largest['error']:.0%} of it; {largest['mended_by']}"]
