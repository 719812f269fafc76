"""The figures that surfaces tell, by the names they have in ``metrics.json``, and in words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

TRUE_ROOM, PROXY_ALONE = "the true room's mesh", "the proxy alone"
"""By what it is told where the surfaces are, and which captures saw."""

RIGHT_DEPTH = 0.05
"""A depth is right within this share of the true one."""

SURFACE_TOLERANCE_M = 0.05
"""Distance within which two surfaces are taken to be one, of the F-score."""

REGION_KINDS = ("psnr_seen", "psnr_unseen", "unseen")
"""PSNR in dB of the pixels that captures saw and of the others, and the share of the latter."""

DEPTH_KINDS = ("depth_error", "depth_right", "proxy_depth_error", "proxy_depth_right")
"""Of an arm's asset and of the proxy: median relative error of depth, and the share of pixels within 5 %."""

SURFACE_KINDS = tuple(f"{of}_{kind}" for of in ("proxy", "collision") for kind in ("fscore", "precision", "recall"))
"""Of the proxy's surface and of the collision surface, at 5 cm."""

SEEN_BY = "seen_by"
"""Beside these: by what it was told what captures saw."""


def region_psnr(figures: Mapping[str, Any], kind: str) -> float | None:
    """A region's PSNR of an arm or a view: None where the region has no pixels, infinite where it has no error."""
    return None if kind not in figures else math.inf if figures[kind] is None else float(figures[kind])


def unseen_told(arm: Mapping[str, Any]) -> str:
    """What share of the pixels no capture saw, and by what that was told; "" where it was not."""
    told_by, share = arm.get(SEEN_BY), arm.get("unseen")
    if told_by is None or share is None:
        return ""
    about = ", so it is approximate" if told_by == PROXY_ALONE else ""
    return f"{share:.0%} of the pixels were seen by no capture, told by {told_by}{about}"


def geometry_lines(arm: Mapping[str, Any]) -> list[str]:
    """The refined arm's figures of geometry as lines for a person; those that were not measured are left out."""
    lines = []
    for kind, label in (("depth", "the refined asset's depth"), ("proxy_depth", "the proxy's depth")):
        if f"{kind}_error" in arm:
            error, right = arm[f"{kind}_error"], arm[f"{kind}_right"]
            lines.append(f"{label}: median error {error:.1%}, {right:.0%} of the pixels within {RIGHT_DEPTH:.0%}")
    for kind, label in (("proxy", "proxy"), ("collision", "collision surface")):
        if f"{kind}_fscore" in arm:
            fscore, precision, recall = (arm[f"{kind}_{part}"] for part in ("fscore", "precision", "recall"))
            at = f"{100 * SURFACE_TOLERANCE_M:.0f} cm"
            lines.append(f"{label}: F-score {fscore:.3f} at {at}, precision {precision:.3f}, recall {recall:.3f}")
    return lines
