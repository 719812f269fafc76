"""The arms that are trained to compare with: methods of others, and Algorithm 1 without generated views."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from ..bundle.runner import Plan, Runner
from ..bundle.scene import Scene
from ..captures.store import CAPTURES
from ..config.training_settings import TrainingSettings
from ..core.progress import SILENT, Progress, SideBySide
from ..core.threads import in_threads_of_kernels
from ..geometry.stereo.observed_geometry import OBSERVED
from ..refine.capture_steps import AlignedPriors, RegisteredCaptures
from ..refine.steps import Steps
from ..refine.visual_asset import vanilla_asset
from ..splats.artifacts import INITIAL_ASSET, REFINED_ASSET
from ..splats.asset import SplatAsset
from ..splats.backends import cpu
from ..splats.training.observations import Observation
from .arms import ARMS, WITHOUT_GENERATED, baseline_settings


def train_arms(scene: Scene, progress: Progress = SILENT, arms: Collection[str] = tuple(ARMS)) -> None:
    """See that ``arms`` are there; each is passed over while nothing that it is made of has changed."""
    baselines = baseline_settings(scene.declaration.settings.training)
    train_baselines(scene, {arm: baselines[arm] for arm in baselines if arm in arms}, progress)
    if WITHOUT_GENERATED in arms:
        train_without_generated_views(scene, progress)


def train_baselines(scene: Scene, baselines: Mapping[str, TrainingSettings], progress: Progress = SILENT) -> None:
    """3DGS from the same observed points and captures, with the refinement's total number of steps.

    On the processor they are trained side by side where Numba's threads bear it: two of a thread each take three
    quarters of the time that they take one after the other.
    """
    h = scene.declaration.settings
    steps = h.rounds * h.training.steps_per_round

    def published(runner: Runner, arm: str, asset: SplatAsset | None = None, seconds: float = 0.0) -> None:
        made = replace(REFINED_ASSET, name=ARMS[arm].asset)
        parameters = [baselines[arm], steps, h.seed]
        runner.make(made, lambda *_: asset, CAPTURES, OBSERVED, settings=parameters, seconds=seconds)

    plan = Plan(scene)
    for arm in baselines:
        published(plan, arm)
    waiting = [arm for arm, step in zip(baselines, plan.steps, strict=True) if step.why]
    if not waiting:
        return
    observed = scene.read(OBSERVED)
    seen = [Observation(capture.camera, capture.image()) for capture in scene.read(CAPTURES)]
    title = f"Training {', '.join(ARMS[arm].label for arm in waiting)}"
    with progress.task(title, steps * len(waiting)) as task:
        beside = SideBySide(task, progress)

        def trained(arm: str) -> tuple[SplatAsset, float]:
            began_s, rng = time.monotonic(), np.random.default_rng([h.seed, 1])
            asset = vanilla_asset(observed.points, observed.colours, seen, steps, baselines[arm], rng, beside)
            return asset, time.monotonic() - began_s

        on_processor = h.training.backend in cpu.BACKENDS
        found = in_threads_of_kernels(trained, waiting, at_a_time=0 if on_processor else 1)
        for arm, (asset, seconds) in zip(waiting, found, strict=True):
            published(Runner(scene), arm, asset, seconds)


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
