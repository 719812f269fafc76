"""How photographs whose poses are known are solved without them, by each matcher: how many, how well, how fast.

Errors are those after the best similarity: rotations tell its rotation, places its scale and shift, so that places
along a line tell too.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.solving.solving import solve_poses
from r2sego_blender.commands.bench_defaults import SOLVING_COUNT
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import rotation_angle_rad
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.progress import SILENT, Progress
from r2sego_blender.core.resources import processor

_MATCHERS = {"sift": "SIFT alone", "xfeat": "XFeat beside it"}


def bench_solving(
    captures: Path,
    poses: Path | None = None,
    first: int = 0,
    count: int = SOLVING_COUNT,
    every: int = 1,
    turn: float = 0.0,
    progress: Progress = SILENT,
) -> dict[str, Any]:
    """Solve ``count`` photographs of a walk, from the ``first``, each ``every``-th or ``turn`` degrees on.

    ``captures`` and ``poses`` are those of ``import_captures``; solving sees neither poses nor lenses. Returns
    JSON-ready figures of each matcher. Raises CaptureError where fewer than three photographs are left.
    """
    told = import_captures(captures, poses, CaptureSettings(), progress).captures
    chosen = chosen_of_walk(told, first, count, every, turn)
    if len(chosen) < 3:
        raise CaptureError(
            f"{len(chosen)} photographs are left", where=captures, cure="Ask for more, or smaller turns."
        )
    turns = [_turn_deg(a, b) for a, b in pairwise(chosen)]
    figures: dict[str, Any] = {"machine": processor(), "captures": str(captures), "photographs": len(chosen)}
    figures |= {"turns_deg": [round(one, 1) for one in turns]}
    for matcher in _MATCHERS:
        with tempfile.TemporaryDirectory(prefix="r2sego-solving-") as folder:
            for capture in chosen:
                shutil.copy(capture.image_path, Path(folder, capture.name))
            figures[matcher] = _solved(Path(folder), chosen, CaptureSettings(matcher=matcher), progress)
    return figures


def chosen_of_walk(captures: Sequence[Capture], first: int, count: int, every: int, turn_deg: float) -> list[Capture]:
    """Of the captures in their order: each ``every``-th from the ``first`` that is turned far enough from the last."""
    chosen: list[Capture] = []
    for capture in captures[first::every]:
        if len(chosen) < count and (not chosen or _turn_deg(chosen[-1], capture) >= turn_deg):
            chosen.append(capture)
    return chosen


def pose_errors(found: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors (n,) of places, in shares of how far the true ones (n, 4, 4) spread, and of rotations, degrees."""
    rotation = Rotation.from_matrix(true[:, :3, :3] @ found[:, :3, :3].transpose(0, 2, 1)).mean().as_matrix()
    places, right = found[:, :3, 3] @ rotation.T, true[:, :3, 3]
    places, right = places - places.mean(axis=0), right - right.mean(axis=0)
    scale = (places * right).sum() / max((places**2).sum(), 1e-30)
    spread = np.sqrt((right**2).sum(axis=1).mean())
    off = np.linalg.norm(scale * places - right, axis=1) / spread
    turned = [rotation_angle_rad(rotation @ a[:3, :3], b[:3, :3]) for a, b in zip(found, true, strict=True)]
    return off, np.degrees(turned)


def lines(figures: Mapping[str, Any]) -> list[str]:
    """The figures as lines for a person."""
    turns = figures["turns_deg"]
    text = [f"{figures['machine']}", f"{figures['captures']}: {figures['photographs']} photographs"]
    text.append(f"turned from one to the next by {np.median(turns):.0f} degrees, {max(turns):.0f} at most")
    for matcher, title in _MATCHERS.items():
        one = figures[matcher]
        told = one["failure"] or (
            f"{one['registered']} registered; places off by {100 * one['place']:.1f} % of their spread, at most "
            f"{100 * one['worst_place']:.1f} %; turned by {one['degrees']:.2f} degrees, at most "
            f"{one['worst_degrees']:.2f}; focal length {100 * one['focal']:+.1f} %"
        )
        text.append(f"{title:<16} {told}; {one['seconds']:.0f} s")
    return text


def _solved(folder: Path, chosen: Sequence[Capture], settings: CaptureSettings, progress: Progress) -> dict[str, Any]:
    began_s = time.perf_counter()
    try:
        photographs, source = solve_poses(folder, settings, progress)
    except CaptureError as error:
        return {"registered": 0, "failure": error.what, "seconds": time.perf_counter() - began_s}
    seconds = time.perf_counter() - began_s
    by_name = {capture.name: capture for capture in chosen}
    of = [by_name[one.name] for one in photographs]
    off, turned = pose_errors(
        np.array([one.world_from_camera for one in photographs]),
        np.array([capture.camera.world_from_camera for capture in of]),
    )
    focal = [
        np.log(one.lens.fx / one.lens.width * lens.width / lens.fx)
        for one, lens in zip(photographs, (capture.lens or capture.camera for capture in of), strict=True)
    ]
    return {
        "registered": len(photographs),
        "source": source,
        "failure": "",
        "place": float(np.median(off)),
        "worst_place": float(off.max()),
        "degrees": float(np.median(turned)),
        "worst_degrees": float(turned.max()),
        "focal": float(np.expm1(np.median(focal))),
        "seconds": seconds,
    }


def _turn_deg(a: Capture, b: Capture) -> float:
    return float(np.degrees(rotation_angle_rad(a.camera.world_from_camera, b.camera.world_from_camera)))
