"""What surfaces tell of an arm: its error where captures saw and where none did, and its depth; and of geometry."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...bundle.scene import Scene
from ...captures.capture import Capture
from ...core.errors import R2SEgoError
from ...core.json_files import rounded
from ...core.progress import SILENT, Progress
from ...geometry.collision.collision_files import MESH_OBJ, REFINED_COLLISION, read_obj
from .figures import SEEN_BY
from .geometry_errors import FOUND_SAMPLES, DepthError, Surface, surface_score
from .regions import RegionScore, mean_score, region_score
from .scene_surfaces import SceneSurfaces


@dataclass(frozen=True)
class ArmFigures:
    """An arm's figures by kind, over all views and of each by its name, as ``metrics.json`` has them.

    A kind that was not measured is not there; a PSNR of None is that of a region without any error.
    """

    whole: Mapping[str, Any]
    views: Mapping[str, Mapping[str, Any]]

    def with_whole(self, more: Mapping[str, Any]) -> ArmFigures:
        """The same with more figures of the whole arm."""
        return ArmFigures({**self.whole, **more}, self.views)


def arm_figures(
    surfaces: SceneSurfaces, views: Sequence[Capture], images: Sequence[np.ndarray], depths: Sequence[np.ndarray]
) -> ArmFigures:
    """Of an arm's ``images`` (H, W, 3) and the expected ``depths`` (H, W), planar metres, at the ``views``.

    ``depths`` are empty where the arm shows pictures alone.
    """
    each = [
        region_score(image, view.image(), surface.seen)
        for image, view, surface in zip(images, views, surfaces.views, strict=True)
    ]
    of_depth = _depth_errors("depth", depths, surfaces)
    entries = [_regions(region) for region in each]
    for index, entry in enumerate(entries):
        entry |= of_depth(slice(index, index + 1))
    named = {view.name: entry for view, entry in zip(views, entries, strict=True)}
    return ArmFigures({**_regions(mean_score(each)), **of_depth(slice(None)), SEEN_BY: surfaces.told_by}, named)


def geometry_figures(scene: Scene, surfaces: SceneSurfaces, progress: Progress = SILENT) -> dict[str, float | None]:
    """Of the last proxy and of the refined collision surface; empty where the true room is not known.

    A surface that cannot be scored is told, and left out.
    """
    if surfaces.true is None:
        return {}
    found = _depth_errors("proxy_depth", [view.proxy_depth for view in surfaces.views], surfaces)(slice(None))
    rng = np.random.default_rng(0)  # of all seeds alike: paired scores have the same points
    true = surfaces.true.surface(rng)
    meshes: Mapping[str, Callable[[], tuple[np.ndarray, np.ndarray]]] = {
        "proxy": lambda: (surfaces.proxy.vertices, surfaces.proxy.faces),
        "collision": lambda: read_obj(scene.read(REFINED_COLLISION) / MESH_OBJ),
    }
    for name, mesh in progress.track(list(meshes.items()), "Scoring surfaces"):
        try:
            score = surface_score(Surface(*mesh(), FOUND_SAMPLES, rng), true, surfaces.true.visible)
        except R2SEgoError as error:
            progress.message(f"the {name} surface is not scored: {error}", "warning")
            continue
        found |= {f"{name}_{kind}": rounded(getattr(score, kind)) for kind in ("fscore", "precision", "recall")}
    return found


def _regions(region: RegionScore) -> dict[str, float | None]:
    found: dict[str, float | None] = {"unseen": rounded(region.unseen)}
    for kind in ("psnr_seen", "psnr_unseen"):
        psnr = getattr(region, kind)
        found |= {} if psnr is None else {kind: rounded(psnr)}
    return found


def _depth_errors(
    name: str, depths: Sequence[np.ndarray], surfaces: SceneSurfaces
) -> Callable[[slice], dict[str, float | None]]:
    """The errors of some of the views' depths; none where the truth is not known."""
    true = [view.true_depth for view in surfaces.views if view.true_depth is not None]

    def of(part: slice) -> dict[str, float | None]:
        error = DepthError.of(depths[part], true[part]) if true and depths else None
        return {} if error is None else {f"{name}_error": rounded(error.median), f"{name}_right": rounded(error.right)}

    return of
