"""What a round's rollouts came to: every attempt with its outcome, and how often each fails."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from typing import Any

from ..bundle.scene import Scene
from ..robot.rollouts.rollout import ROLLOUTS
from ..views.selection import ablations


def describe_rollouts(scene: Scene, round_index: int) -> dict[str, Any]:
    """A round's rollouts, JSON-ready. Raises RobotError where there are none.

    An attempt's ``frame`` and ``time_s`` are the last before a failure, or the last at all;
    ranges are over the successful ones.
    """
    declared = scene.declaration
    rollouts = scene.read(ROLLOUTS.of_round(round_index))
    attempts = [
        {
            "attempt": number,
            "success": rollout.success,
            "behaviour": rollout.behaviour,
            "controller": rollout.controller,
            "reason": rollout.reason,
            "detail": rollout.detail,
            "frame": rollout.frame,
            "time_s": float(rollout.times_s[-1]) if len(rollout.times_s) else 0.0,
            "frames": len(rollout.camera_poses),
            "seed": list(rollout.seed),
            "quality": dataclasses.asdict(rollout.quality),
        }
        for number, rollout in enumerate(rollouts)
    ]
    succeeded = [attempt for attempt in attempts if attempt["success"]]
    return {
        "scene": str(scene.path),
        "round": round_index,
        "robot": declared.robot,
        "scope": declared.scope,
        "controllers": sorted({attempt["controller"] for attempt in attempts}),
        "ablations": list(ablations(declared.settings.selection)),
        "wanted": declared.settings.rollouts.successes,
        "succeeded": len(succeeded),
        "attempts": len(attempts),
        "failures": dict(Counter(a["reason"] for a in attempts if not a["success"]).most_common()),
        "candidates": sum(attempt["frames"] for attempt in succeeded),
        "camera_height_m": _range(succeeded, "camera_height_m"),
        "camera_pitch_deg": _range(succeeded, "camera_pitch_deg"),
        "rollouts": attempts,
    }


def lines(described: dict[str, Any]) -> list[str]:
    """The rollouts as lines for a person."""
    d = described
    outcome = f"{d['succeeded']} of {d['wanted']} rollouts succeeded in {d['attempts']} attempts"
    text = [
        f"{d['scene']}, round {d['round']}: {outcome}",
        f"robot: {d['robot']}, scope: {d['scope']}, controller: {', '.join(d['controllers'])}",
    ]
    text += [f"ablation: {ablation}" for ablation in d["ablations"]]
    if d["failures"]:
        counts = ", ".join(f"{count} {reason}" for reason, count in d["failures"].items())
        text.append(f"failed: {counts}")
    if d["camera_height_m"]:
        (low_m, high_m), (low_deg, high_deg) = d["camera_height_m"], d["camera_pitch_deg"]
        text.append(
            f"{d['candidates']} candidate views from {low_m:.2f} to {high_m:.2f} m high, "
            f"looking {low_deg:.0f} to {high_deg:.0f} degrees down"
        )
    text += ["", f"{'attempt':>7}  {'behaviour':<14}{'outcome':<16}{'frame':>6}{'seconds':>9}  particulars"]
    for a in d["rollouts"]:
        outcome = "succeeded" if a["success"] else a["reason"]
        line = f"{a['attempt']:>7}  {a['behaviour']:<14}{outcome:<16}{a['frame']:>6}{a['time_s']:>9.1f}"
        text.append(f"{line}  {a['detail'] or _measured(a['quality'])}".rstrip())
    return text


def _measured(quality: dict[str, Any]) -> str:
    """What is worth telling of a rollout that went well."""
    facts = []
    if quality["foot_slide_m"] > 0.0:
        facts.append(f"feet slid {100.0 * quality['foot_slide_m']:.1f} cm at most")
    if quality["seated_s"] > 0.0:
        facts.append(f"seated for {quality['seated_s']:.1f} s")
    return ", ".join(facts)


def _range(attempts: Sequence[dict[str, Any]], name: str) -> list[float] | None:
    """The lowest and the highest of a measurement's ranges."""
    ranges = [attempt["quality"][name] for attempt in attempts]
    return [min(low for low, _ in ranges), max(high for _, high in ranges)] if ranges else None
