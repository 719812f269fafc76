"""The arms that are trained to compare with: methods of others, and Algorithm 1 without generated views."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from ..bundle.runner import Runner
from ..bundle.scene import Scene
from ..captures.capture import Capture
from ..captures.store import CAPTURES
from ..config.presets import SPARSE_STABLE_SH3, VANILLA_3DGS
from ..config.training_settings import TrainingSettings
from ..core.progress import SILENT, Progress
from ..geometry.stereo.observed_geometry import OBSERVED, ObservedGeometry
from ..refine.capture_steps import AlignedPriors, RegisteredCaptures
from ..refine.steps import Steps
from ..refine.visual_asset import vanilla_asset
from ..splats.artifacts import INITIAL_ASSET, REFINED_ASSET
from ..splats.asset import SplatAsset
from ..splats.training.observations import Observation
from .arms import ARMS, GAUSSGYM, SAME_POINTS, VANILLA, WITHOUT_GENERATED


def train_arms(scene: Scene, progress: Progress = SILENT, arms: Collection[str] = tuple(ARMS)) -> None:
    """See that ``arms`` are there; each is passed over while nothing that it is made of has changed."""
    training = scene.declaration.settings.training
    if VANILLA in arms:
        train_baseline(scene, VANILLA, replace(training, **VANILLA_3DGS), progress)
    if GAUSSGYM in arms:
        train_baseline(scene, GAUSSGYM, replace(training, **SPARSE_STABLE_SH3), progress)
    if SAME_POINTS in arms:
        train_baseline(scene, SAME_POINTS, training, progress)
    if WITHOUT_GENERATED in arms:
        train_without_generated_views(scene, progress)


def train_baseline(scene: Scene, arm: str, training: TrainingSettings, progress: Progress = SILENT) -> None:
    """3DGS from the same observed points and captures, with the refinement's total number of steps.

    Vanilla's rates, densification and resolution are the original 3DGS', the GaussGym condition's the same but that
    none is added; the same points have this project's, which never densify.
    """
    h = scene.declaration.settings
    steps = h.rounds * h.training.steps_per_round

    def compute(captures: Sequence[Capture], observed: ObservedGeometry) -> SplatAsset:
        seen = [Observation(capture.camera, capture.image()) for capture in captures]
        rng = np.random.default_rng([h.seed, 1])
        title = f"Training {ARMS[arm].label}"
        return vanilla_asset(observed.points, observed.colours, seen, steps, training, rng, progress, title)

    made = replace(REFINED_ASSET, name=ARMS[arm].asset)
    Runner(scene).make(made, compute, CAPTURES, OBSERVED, settings=[training, steps, h.seed])


def train_without_generated_views(scene: Scene, progress: Progress = SILENT) -> None:
    """The rounds of Algorithm 1 without lines 7 to 12: geometry, backdrop and training as they are, D_ego empty.

    What the refined asset is worth beyond it is what generated views are worth.
    """
    under = ARMS[WITHOUT_GENERATED].asset.removesuffix(REFINED_ASSET.name)
    step = Steps(Runner(scene), scene.declaration.settings, progress, under=under)
    captures, priors, asset = RegisteredCaptures(), AlignedPriors(), INITIAL_ASSET
    for index in range(step.h.rounds):
        proxy = step.geometry_proxy(index, captures, OBSERVED, priors, asset)
        asset = step.update_visual_asset(index, asset, captures, priors, proxy, ())
    step.publish_asset(asset)
