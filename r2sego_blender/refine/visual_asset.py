"""The visual asset of the loop: its start, its growth, and its refinement round by round.

Stands on the trainer in ``splats`` and on depth rendered from the proxy; knows no bundle.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from ..config.presets import EVERY_PIXEL
from ..config.training_settings import TrainingSettings
from ..core.cameras import Camera
from ..core.progress import SILENT, Progress
from ..splats.asset import SplatAsset
from ..splats.rendering.rasterizer import render
from ..splats.training.initialization import DepthView, from_depth, from_points, surface_normals
from ..splats.training.observations import Observation
from ..splats.training.training import train
from ..splats.training.training_pictures import shown_from

MISSING_ALPHA = 0.8
"""Below this alpha the asset renders too little to train on. The setting ``selection.alpha_threshold``,
by default the same, is for the choice of views alone."""

_FILL_COARSENESS = 2
"""Discs that fill holes are this much wider than the mean one on stereo: their depth is completed,
often from one capture, and fine discs at a guessed depth only overfit."""

_AGREEMENT_SCALE = 0.12
"""Colour difference at which a generated pixel's weight has fallen to 1/e."""

_AGREEMENT_WINDOW_PX = 5

_LEAST_SHARE = 0.1
"""A generated view is drawn as if at least this share of its pixels taught something, so that no draw
of it counts more than ten times a capture's."""

_SLOWEST_ROUND = 2
"""The round, counted from 0, from which on learning rates fall no more."""

_RATES = tuple(f"{name}_learning_rate" for name in ("position", "scale", "rotation", "opacity", "colour"))
"""The learning rates of the Gaussians; that of higher harmonics follows the colours'."""


@dataclass(frozen=True)
class PseudoView:
    """A generated frame at its estimated pose, with the proxy's depth there.

    ``confidence`` (H, W) float32 in [0, 1] is the generator's own.
    """

    view: DepthView
    confidence: np.ndarray


def disc_stride_px(cameras: Sequence[Camera], settings: TrainingSettings) -> int:
    """Pixels a side that share one Gaussian, so that the captures fit into the budget.

    About half of the captures' discs show what another one shows better and fall away.
    """
    pixels = sum(camera.width * camera.height for camera in cameras)
    discs = pixels / _mean_stride(1, settings.detailed_share) ** 2  # at a stride of one pixel
    return max(settings.disc_stride_px, round(math.sqrt(discs / (2.0 * settings.max_gaussians))))


def _mean_stride(stride_px: int, detailed_share: float) -> float:
    """The stride that would give as many discs everywhere: ``detailed_share`` has four for one."""
    return 2.0 * stride_px / math.sqrt(1.0 + 3.0 * detailed_share)


def grow(
    asset: SplatAsset, views: Sequence[DepthView], settings: TrainingSettings, rng: np.random.Generator
) -> SplatAsset:
    """Add discs where a view's geometry shows a surface that the asset does not render.

    Views come in order, each seeing what the ones before have added; their strides are
    coarsened by ``_FILL_COARSENESS``. The budget of Gaussians is hard: what does not fit is
    left out at random, and the discs of an asset that is beyond it already grow for those left out.
    """
    asset = _within(asset, settings.max_gaussians, rng)
    for view in views:
        missing = render(asset, view.camera).alpha < MISSING_ALPHA
        stride_px = math.ceil(_FILL_COARSENESS * _mean_stride(view.stride_px, view.detailed_share))
        added = from_depth(view.camera, view.depth, view.image, stride_px, missing)
        room = settings.max_gaussians - len(asset)
        if len(added) > room:
            chosen = np.zeros(len(added), bool)
            chosen[rng.choice(len(added), max(room, 0), replace=False)] = True
            added = added.subset(chosen)
        asset = asset.concatenated(added)
    return asset


def _within(asset: SplatAsset, most: int, rng: np.random.Generator) -> SplatAsset:
    """``most`` of the discs at random, so much wider that they cover what all did; all where they are fewer.

    A sensor's depth can fill more pixels than the share that ``disc_stride_px`` counts on.
    """
    if len(asset) <= most:
        return asset
    kept = asset.subset(np.sort(rng.choice(len(asset), most, replace=False)))
    return dataclasses.replace(kept, log_scales=kept.log_scales + np.float32(0.5 * math.log(len(asset) / most)))


def agreement(asset: SplatAsset, pseudo: PseudoView) -> np.ndarray:
    """(H, W) float32 in [0, 1]: how far a generated frame agrees with the asset as it is.

    Where the asset, trained on the captures, renders something else than the generator
    made, one of the two is wrong and the pixel teaches little; where it renders nothing,
    the generator's own confidence stands.
    """
    view = pseudo.view
    now = render(asset, view.camera)
    apart = np.abs(now.colour - view.image).mean(axis=2)
    apart = cv2.blur(apart, (_AGREEMENT_WINDOW_PX, _AGREEMENT_WINDOW_PX))
    agreeing = np.exp(-((apart / _AGREEMENT_SCALE) ** 2))
    return np.where(now.alpha >= MISSING_ALPHA, agreeing * pseudo.confidence, pseudo.confidence)


def settings_of_round(settings: TrainingSettings, index: int) -> TrainingSettings:
    """The training of round ``index``, counted from 0: the first is as ``settings`` say.

    Later rounds start from an asset that knows the captures already. At full rates each would
    forget and learn them again, and lose a little; so the second takes
    ``later_rounds_learning_rate_ratio`` of the Gaussians' rates and looks at every pixel, and the
    third takes that share of the second's. All after it go on as the third: slower still, they
    would not learn what is new in them.
    """
    if index == 0:
        return settings
    share = settings.later_rounds_learning_rate_ratio ** min(index, _SLOWEST_ROUND)
    slower: dict[str, Any] = {name: getattr(settings, name) * share for name in _RATES}
    return dataclasses.replace(settings, **{**EVERY_PIXEL, **slower})


def update_visual_asset(
    asset: SplatAsset,
    backdrop: SplatAsset,
    captures: Sequence[DepthView],
    pseudo_observations: Sequence[PseudoView],
    settings: TrainingSettings,
    rng: np.random.Generator,
    progress: Progress = SILENT,
) -> SplatAsset:
    """UpdateVisualAsset of Algorithm 1: A^l refined on captures and all pseudo-observations.

    The captures' and the proxy's geometry first fills what the asset misses. The backdrop
    stands behind it unchanged, so that the asset need not paint what is not there. A first share
    of the steps sees the captures alone; then pseudo-observations join, at lower weight
    and weighted pixel by pixel with their agreement with that capture-trained asset,
    while captures are drawn more often: they stay the anchors (Sec. III-C).
    """
    asset = grow(asset, [*captures, *(p.view for p in pseudo_observations)], settings, rng)
    real = [_observation(v, backdrop, settings, weight=settings.real_weight * v.weight) for v in captures]
    first = round(settings.captures_first_share * settings.steps_per_round)
    title = "Training on captures"
    asset = train(asset, real, first, settings, rng, progress, title, shown_from(real, title, progress))
    anchors = [dataclasses.replace(o, draws=settings.capture_oversampling) for o in real]
    taught = pseudo_observations if settings.synthetic_weight > 0.0 else ()
    synthetic = [_pseudo_observation(p, asset, backdrop, settings) for p in taught]
    rest = settings.steps_per_round - first
    title, both = "Training on all views", [*anchors, *synthetic]
    return train(asset, both, rest, settings, rng, progress, title, shown_from(both, title, progress))


def _pseudo_observation(
    pseudo: PseudoView, asset: SplatAsset, backdrop: SplatAsset, settings: TrainingSettings
) -> Observation:
    """A generated view as training sees it beside captures: drawn as often as it has something to teach.

    Each pixel's gradient counts w_syn times its agreement with ``asset``, over all draws together. A view
    of little weight is drawn seldom in place of being looked at often for little: those steps are the
    captures', which would otherwise not be learnt to the end.
    """
    trust = agreement(asset, pseudo)
    share = max(float(trust.mean()), _LEAST_SHARE)
    return dataclasses.replace(
        _observation(pseudo.view, backdrop, settings, weight=1.0 / share),
        draws=settings.synthetic_weight * share,
        confidence=trust,
        refines_exposure=settings.exposure_learning_rate > 0.0,
        refines_pose=settings.pose_learning_rate > 0.0,
    )


def _observation(view: DepthView, backdrop: SplatAsset, settings: TrainingSettings, weight: float) -> Observation:
    """The view as training sees it: with its depth, opaque where it has any, the backdrop behind."""
    normals = None
    if settings.normal_weight > 0.0:
        normals = surface_normals(view.camera, view.depth).astype(np.float32)
    return Observation(
        view.camera,
        view.image,
        weight,
        background=render(backdrop, view.camera).colour,
        opaque=(view.depth > 0.0).astype(np.float32),
        depth=view.depth,
        normals=normals,
    )


def vanilla_asset(
    points: np.ndarray,
    colours: np.ndarray,
    captures: Sequence[Observation],
    steps: int,
    settings: TrainingSettings,
    rng: np.random.Generator,
    progress: Progress = SILENT,
) -> SplatAsset:
    """The baseline: 3DGS from the observed points (P, 3), trained on the captures alone."""
    start = from_points(points, colours, settings, rng)
    return train(start, captures, steps, settings, rng, progress, "Training vanilla 3DGS")
