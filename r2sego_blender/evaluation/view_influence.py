"""What each generated view did on the frozen views: the change of the squared error, pixel by pixel.

Compared are the asset that was refined with generated views, and the one without. A pixel's change belongs
to the generated views that see what the refined asset shows there, in equal parts; where none does, it is
what training on them changed elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..bundle.scene import Scene
from ..captures.capture import Capture
from ..core.cameras import Camera
from ..core.errors import R2SEgoError
from ..core.progress import SILENT, Progress
from ..generation.ego_views import VIEWS
from ..splats.artifacts import REFINED_ASSET
from ..splats.rendering.rasterizer import render
from .arms import REFINED, WITHOUT_GENERATED
from .surfaces.regions import seen_by


def view_influence(
    scene: Scene,
    views: Sequence[Capture],
    images: Mapping[str, Sequence[np.ndarray]],
    depths: Sequence[np.ndarray],
    progress: Progress = SILENT,
) -> dict[str, Any]:
    """Shares of the squared error without generated views that these removed; negative ones were added.

    ``images`` (H, W, 3) by arm and the refined asset's ``depths`` (H, W) in metres are those of the frozen
    ``views``. The entry of ``metrics.json``: ``removed`` in all, ``elsewhere``, and ``views``, of each
    ``round``, ``rank`` and ``removed``. Empty where one of the two arms was not scored, no view was
    trained on, or they cannot be read.
    """
    if not {REFINED, WITHOUT_GENERATED} <= images.keys():
        return {}
    try:
        rounds = range(scene.newest_round("asset.ply") + 1)
        taught = [(index, one) for index in rounds for one in scene.read(VIEWS.of_round(index))]
        asset = scene.read(REFINED_ASSET)
    except R2SEgoError:
        return {}
    if not taught:
        return {}
    shown = [(one.camera, render(asset, one.camera).depth) for _, one in taught]
    removed, elsewhere, error = np.zeros(len(taught)), 0.0, 0.0
    for index, view in enumerate(progress.track(views, "What generated views did")):
        truth = view.image()
        without, refined = (((images[arm][index] - truth) ** 2).sum(axis=2) for arm in (WITHOUT_GENERATED, REFINED))
        error += float(without.sum())
        of_views, of_none = attributed(view.camera, depths[index], without - refined, shown)
        removed += of_views
        elsewhere += of_none
    scale = 1.0 / max(error, 1e-12)
    return {
        "removed": round(float(removed.sum() + elsewhere) * scale, 4),
        "elsewhere": round(elsewhere * scale, 4),
        "views": [
            {"round": index, "rank": one.rank, "removed": round(float(gain) * scale, 4)}
            for (index, one), gain in zip(taught, removed, strict=True)
        ],
    }


def attributed(
    camera: Camera, depth: np.ndarray, change: np.ndarray, shown: Sequence[tuple[Camera, np.ndarray]]
) -> tuple[np.ndarray, float]:
    """The sum of a picture's ``change`` (H, W), shared out: (V,) to the views, and the rest, which none of them sees.

    ``depth`` (H, W) is what the picture shows, and ``shown`` are cameras of the views with their depths of the
    same asset, planar metres, 0 for nothing, which no view sees.
    """
    surface = depth > 0.0
    points = camera.unproject(depth)[surface]
    seen = np.array([seen_by(points, other, other_depth) for other, other_depth in shown]).reshape(
        len(shown), len(points)
    )
    parts = change[surface] / np.maximum(seen.sum(axis=0), 1)
    shares = seen @ parts
    return shares, float(change.sum() - shares.sum())


def told(entry: Mapping[str, Any]) -> str:
    """The entry of ``metrics.json`` as a sentence; "" where there is none."""
    if not entry.get("views"):
        return ""
    gains = [view["removed"] for view in entry["views"]]
    better, worse = sum(gain > 0.0 for gain in gains), sum(gain < 0.0 for gain in gains)
    return (
        f"generated views removed {100.0 * entry['removed']:.1f}% of the squared error without them: "
        f"{better} of {len(gains)} removed some where they look, {worse} added some"
    )
