"""RobotProxy and SelectReferences of Algorithm 1: a round's target views and their references."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..config.settings import SelectionSettings
from ..core.cameras import Camera
from ..core.progress import SILENT, Progress
from ..geometry.proxy.proxy import GeometryProxy
from ..geometry.visibility.rasterizer import MeshRasterizer
from ..robot.rollouts.candidates import Candidates
from ..splats.asset import SplatAsset
from .references import with_references
from .scoring.scores import support_scores
from .selection import Selection, select_targets


def allocate_views(
    candidates: Candidates,
    lens: Camera,
    asset: SplatAsset,
    proxy: GeometryProxy,
    captures: Sequence[Camera],
    settings: SelectionSettings,
    seed: int | Sequence[int] = 0,
    spares: int = 0,
    progress: Progress = SILENT,
) -> Selection:
    """The target views among ``candidates``, seen through ``lens``; each with its reference.

    A function of its arguments alone, to the bit, and the order of the candidates does not
    matter. ``seed`` counts where the settings rank at random. ``spares`` more candidates
    than the budget get a reference: those that stand in for a target that fails later.
    """
    cameras = [lens.at(pose) for pose in candidates.poses]
    deficit, availability = support_scores(cameras, asset, proxy, settings, progress)
    selection = select_targets(
        deficit, availability, candidates.rollout, candidates.frame, settings, progress, np.random.default_rng(seed)
    )
    rasterizer = MeshRasterizer(proxy.vertices, proxy.faces)
    return with_references(
        selection,
        cameras,
        captures,
        lambda camera: rasterizer.render(camera).depth,
        settings,
        settings.target_views + spares,
    )
