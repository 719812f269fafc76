"""How far a round's update came to each generated view that it learnt.

It is told of every round, for it costs two renderings a view. What that is worth is seen only on
held-out views (``evaluation/view_influence.py``): an asset can come near to a wrong picture.
"""

from __future__ import annotations

from ..core.json_files import rounded
from ..generation.ego_views import PseudoObservation
from ..generation.view_effects import ViewEffect
from ..splats.asset import SplatAsset
from ..splats.metrics import psnr
from ..splats.rendering.rasterizer import render
from .visual_asset import MISSING_ALPHA


def view_effect(view: PseudoObservation, before: SplatAsset, after: SplatAsset, backdrop: SplatAsset) -> ViewEffect:
    """Of one view, with ``backdrop`` behind the assets ``before`` and ``after`` the round."""
    behind = render(backdrop, view.camera).colour
    then, now = render(before, view.camera, behind), render(after, view.camera, behind)
    new = round(float((then.alpha < MISSING_ALPHA).mean()), 4)
    return ViewEffect(view.rank, new, *(rounded(psnr(shown.colour, view.image)) for shown in (then, now)))
