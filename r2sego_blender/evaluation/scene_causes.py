"""Why the refined asset is wrong on the frozen views: its squared error split by cause.

Each pixel has exactly one cause, the first of ``CAUSES`` that holds. They are told by the
true room's mesh where it lies beside the frozen views, else by the geometry proxy alone,
which cannot say where it is wrong itself. Truth is read for scoring only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from ..captures.capture import Capture
from ..core.json_files import rounded
from .error_causes import EDGE_PX, CauseShares, near_edges, split
from .surfaces.figures import PROXY_ALONE
from .surfaces.scene_surfaces import SceneSurfaces, ViewSurface

WRONG_DEPTH_M = 0.05
"""Geometry farther than this from the true depth is wrong."""

OFF_SURFACE_M, OFF_SURFACE = 0.10, 0.03
"""Splats farther than the larger of these from the surface, metres and relative, are off it."""

_NOTHING_M = np.float32(1e6)


@dataclass(frozen=True)
class Cause:
    """What a person reads of a cause: its name, what it means, and what mends it."""

    label: str
    meaning: str
    mended_by: str


CAUSES: Mapping[str, Cause] = {
    "wrong_depth": Cause(
        "wrong depth",
        "the geometry proxy is more than 5 cm from the room",
        "shape priors for the objects there, or captures that see those sides",
    ),
    "off_surface": Cause(
        "splats off the surface",
        "the asset's depth is not the surface's: fog, floaters and holes",
        "deleting floaters, a smaller training.max_scale_m, training.depth_weight above 0",
    ),
    "never_seen": Cause(
        "never seen", "no capture sees that surface: its colours are made up", "more captures of that side"
    ),
    "edges": Cause(
        "edges",
        "within 2 px of a depth edge",
        "larger photographs (captures.max_side_px) and finer splats (training.disc_stride_px)",
    ),
    "appearance": Cause(
        "appearance",
        "all else: blur, light, reflections, exposure",
        "captures nearer to the robot's views, one exposure for all, more steps",
    ),
}
"""In the order in which they are asked; the key is the name in metrics.json."""

_INDEX = {name: index for index, name in enumerate(CAUSES)}


@dataclass(frozen=True)
class ViewCauses:
    """One frozen view: the cause of each pixel (H, W), an index into ``CAUSES``, and each
    cause's share of the view's squared error."""

    name: str
    labels: np.ndarray
    shares: Mapping[str, CauseShares]


@dataclass(frozen=True)
class SceneCauses:
    """The causes over all frozen views.

    ``told_by`` is ``TRUE_ROOM`` or ``PROXY_ALONE``; ``shares`` of a cause that cannot be told is
    None; ``note`` says why a true mesh was not used.
    """

    told_by: str
    shares: Mapping[str, CauseShares | None]
    views: tuple[ViewCauses, ...]
    note: str = ""


def split_by_cause(
    surfaces: SceneSurfaces, views: Sequence[Capture], images: Sequence[np.ndarray], asset_depths: Sequence[np.ndarray]
) -> SceneCauses:
    """Split the squared error of the refined asset's ``images`` (H, W, 3) by cause.

    ``asset_depths`` (H, W) are the asset's own at the same views, planar metres, 0 where it
    shows nothing. ``surfaces`` are those of the views, in their order.
    """
    labels = [label_pixels(view, asset) for view, asset in zip(surfaces.views, asset_depths, strict=True)]
    photographs = [view.image() for view in views]
    shares: dict[str, CauseShares | None] = dict(split(images, photographs, labels, tuple(CAUSES)))
    if surfaces.told_by == PROXY_ALONE:
        shares["wrong_depth"] = None
    each = tuple(
        ViewCauses(view.name, label, split([image], [photograph], [label], tuple(CAUSES)))
        for view, image, photograph, label in zip(views, images, photographs, labels, strict=True)
    )
    return SceneCauses(surfaces.told_by, shares, each, surfaces.note)


def label_pixels(view: ViewSurface, asset_depth: np.ndarray) -> np.ndarray:
    """(H, W) uint8, an index into ``CAUSES`` for each pixel of a view.

    ``asset_depth`` (H, W) is in planar metres, 0 where nothing is. A depth counts
    as off only where the surface has no such depth within 2 px: what is blended over an edge
    is an edge's error.
    """
    surface = view.known_depth
    wrong = np.zeros(surface.shape, bool)
    if view.true_depth is not None:
        wrong = _apart(view.proxy_depth, view.true_depth, np.float32(WRONG_DEPTH_M))
    tolerance_m = np.maximum(OFF_SURFACE_M, OFF_SURFACE * surface).astype(np.float32)
    off = (surface > 0.0) & _apart(asset_depth, surface, tolerance_m)
    edges = near_edges(surface)
    return np.select([wrong, off, ~view.seen, edges], range(4), _INDEX["appearance"]).astype(np.uint8)


def as_entry(causes: SceneCauses | str) -> dict[str, Any]:
    """The causes as ``metrics.json`` has them; text says why there are none."""
    if isinstance(causes, str):
        return {"unavailable": causes}
    shares = []
    for name, cause in CAUSES.items():
        share = causes.shares[name]
        parts = ("error", "pixels", "psnr")
        figures = {part: None if share is None else rounded(getattr(share, part)) for part in parts}
        shares.append({"cause": name, "label": cause.label, **figures, "mended_by": cause.mended_by})
    told = [name for name, share in causes.shares.items() if share is not None]
    views = [
        {"name": view.name, "error": {name: rounded(view.shares[name].error) for name in told}} for view in causes.views
    ]
    note = {"note": causes.note} if causes.note else {}
    return {"told_by": causes.told_by, "shares": shares, "views": views, **note}


def lines(entry: Mapping[str, Any]) -> list[str]:
    """The ``causes`` of ``metrics.json`` as lines for a terminal."""
    if "unavailable" in entry:
        return [f"causes of the error: not available, {entry['unavailable']}"]
    text = [
        f"squared error of the refined asset by cause, told by {entry['told_by']}",
        f"{'':<24}{'error':>6}{'pixels':>8}{'PSNR dB':>9}  what mends it",
    ]
    for one in entry["shares"]:
        if one["error"] is None:
            text.append(f"{one['label']:<24}{'n/a':>6}{'n/a':>8}{'n/a':>9}  told by a true mesh alone")
            continue
        psnr = "n/a" if one["psnr"] is None else f"{one['psnr']:.2f}"
        text.append(f"{one['label']:<24}{one['error']:>6.0%}{one['pixels']:>8.0%}{psnr:>9}  {one['mended_by']}")
    return [*text, entry["note"]] if "note" in entry else text


def _apart(depth: np.ndarray, surface: np.ndarray, tolerance_m: np.ndarray | np.float32) -> np.ndarray:
    """(H, W) bool: whose depth lies outside all that the surface has within ``EDGE_PX``."""
    square = np.ones((2 * EDGE_PX + 1, 2 * EDGE_PX + 1), np.uint8)
    depth, surface = (np.where(d > 0.0, d, _NOTHING_M).astype(np.float32) for d in (depth, surface))
    nearest, farthest = cv2.erode(surface, square), cv2.dilate(surface, square)
    return (depth < nearest - tolerance_m) | (depth > farthest + tolerance_m)
