"""Training of a splat asset on registered images (Algorithm 1, the asset's update).

The budget of Gaussians is hard. The refinement spends it at the start, on geometry; with
``settings.densification`` Gaussians are added where the images ask for them. Two things keep a
handful of photographs from being learnt by heart: each step does without some Gaussians
(``dropout``), and none gets larger than ``settings.max_scale_m``.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...config.training_settings import TrainingSettings
from ...core.cameras import Camera
from ...core.errors import AssetError
from ...core.progress import SILENT, Progress
from ..asset import SplatAsset
from ..backends.slot import SplatBackend, make_backend
from ..kernels.loss import PhotometricLoss
from ..kernels.packing import HARMONICS, LOG_SCALE, LOGIT_OPACITY, MEAN, QUATERNION, PackedGaussians, rows_of
from ..kernels.tiles import DEPTH_PLANE, TRANSMITTANCE_PLANE
from ..vector_language.aligned_memory import aligned_copy
from .corrections import Correction
from .densification import Densification
from .dropout import Dropout
from .lattice import Lattice
from .observations import Observation, Target, Targets
from .population import Population
from .supervision import depth_gradients

_BLACK = (0.0, 0.0, 0.0)

Watch = Callable[[int, Callable[[], PackedGaussians]], bool]

_GOLDEN_RATIO = 0.5 * (math.sqrt(5.0) - 1.0)

_ONE_PLACE = 1e-3
"""Cameras no farther apart than this share of the Gaussians' spread stand in one place, as poses round."""

_SCENE_MARGIN = 1.1
"""3DGS: a scene's extent is this times the largest distance of a camera from their middle."""


def scene_extent_m(cameras: Sequence[Camera]) -> float:
    """The radius of the cameras' centres around their mean, as 3DGS scales step lengths by."""
    centres = np.stack([camera.centre for camera in cameras])
    radius = np.linalg.norm(centres - centres.mean(axis=0), axis=1).max()
    return float(_SCENE_MARGIN * radius)


def train(
    asset: SplatAsset,
    observations: Sequence[Observation],
    steps: int,
    settings: TrainingSettings,
    rng: np.random.Generator,
    progress: Progress = SILENT,
    title: str = "Training the asset",
    watch: Watch | None = None,
) -> SplatAsset:
    """A new asset that reproduces ``observations`` better than ``asset`` after ``steps`` steps.

    The first steps look at some of an image's pixels, as the settings say. The
    harmonics' degree starts at the highest the asset already uses and rises by one at
    equal intervals. The same inputs and generator state give the
    same bits, for any number of threads, with the default ``settings.backend``. ``watch`` is
    called after every step with the steps done and a function that returns the Gaussians as they
    are, which it must not change; training ends when it returns True. Raises AssetError without
    observations, or with more Gaussians than ``settings.max_gaussians``, and SettingsError when
    the backend cannot run here.
    """
    if not observations:
        raise AssetError("there is no observation to train on", cure="Give at least one registered image.")
    if len(asset) > settings.max_gaussians:
        raise AssetError(
            f"the asset has {len(asset)} Gaussians, more than {settings.max_gaussians}",
            cure="Raise training.max_gaussians or initialise with fewer.",
        )
    degree = _used_degree(asset)
    grows = settings.densification != "none"
    gaussians = PackedGaussians.of(asset.with_degree(settings.sh_degree), settings.max_gaussians * grows)
    population = Population.of(gaussians)
    engine = make_backend(settings.backend, gaussians, population.state)
    extent_m = _extent_m(asset, observations)
    schedule = _Schedule(settings, steps, degree, extent_m)
    densification = Densification(population, steps, extent_m, settings, rng)
    dropout = Dropout(settings.dropout_share, rng)
    trainer = _Trainer(engine, observations, settings)
    draws = _shuffled(observations, rng)
    with progress.task(title, steps) as task:
        for step in range(steps):
            index, stage = next(draws), schedule.at(step)
            lattice = Lattice.drawn(stage.stride, observations[index].camera.shape, rng)
            with engine.leaving_out(dropout.drawn(len(gaussians))):
                trainer.step(index, lattice, stage)
            # One photograph does not say how large a Gaussian at its rim is: without a bound some
            # grow to hundreds of metres, and hang as fog before other views.
            if settings.max_scale_m > 0.0:
                engine.bound_log_scales(math.log(settings.max_scale_m))
            if densification.is_due(step):
                with engine.lent():
                    densification.after(step)
            task.advance()
            if watch is not None and watch(step + 1, lambda: engine.gaussians):
                break
    return engine.gaussians.asset()


@dataclass(frozen=True)
class _Stage:
    """What a step is done with: which pixels (``Lattice.stride``), harmonics' degree, rates a row."""

    stride: int
    degree: int
    rates: np.ndarray


class _Schedule:
    """Pixels' stride, harmonics' degree and learning rates by step."""

    def __init__(self, settings: TrainingSettings, steps: int, degree: int, position_scale: float) -> None:
        self._settings = settings
        self._steps = steps
        self._first_degree = degree
        self._position_scale = position_scale

    def at(self, step: int) -> _Stage:
        """The degree rises by one at equal intervals, from the first to the highest; the
        rates decay exponentially, the means' more than the others (Kerbl et al. 2023)."""
        settings, done = self._settings, step / self._steps
        raises = settings.sh_degree - self._first_degree
        degree = self._first_degree + step * (raises + 1) // self._steps
        annealing = settings.learning_rate_annealing ** (1.0 - 2.0 * done)
        rates = self._rates(settings.position_decay**done) * annealing
        return _Stage(self._stride(done), degree, rates.astype(np.float32))

    def _stride(self, done: float) -> int:
        settings = self._settings
        if done < settings.every_third_pixel_share:
            return 3
        return 2 if done < settings.every_third_pixel_share + settings.every_second_pixel_share else 1

    def _rates(self, decay: float) -> np.ndarray:
        settings = self._settings
        rates = np.empty(rows_of((settings.sh_degree + 1) ** 2), np.float32)
        rates[MEAN:LOG_SCALE] = settings.position_learning_rate * self._position_scale * decay
        rates[LOG_SCALE:QUATERNION] = settings.scale_learning_rate
        rates[QUATERNION:LOGIT_OPACITY] = settings.rotation_learning_rate
        rates[LOGIT_OPACITY] = settings.opacity_learning_rate
        rates[HARMONICS : HARMONICS + 3] = settings.colour_learning_rate
        rates[HARMONICS + 3 :] = settings.colour_learning_rate * settings.harmonics_learning_rate_ratio
        return rates


class _Trainer:
    """One optimisation step after the other, on buffers that are kept."""

    def __init__(self, engine: SplatBackend, observations: Sequence[Observation], settings: TrainingSettings) -> None:
        self._engine = engine
        self._observations = observations
        self._settings = settings
        self._with_geometry = max(settings.depth_weight, settings.normal_weight) > 0.0
        self._targets = Targets(observations, settings.image_cache_mb << 20, self._with_geometry)
        self._losses: dict[tuple[int, int], PhotometricLoss] = {}
        self._corrections = {
            index: Correction(settings, view.refines_exposure, view.refines_pose)
            for index, view in enumerate(observations)
            if view.refines_exposure or view.refines_pose
        }

    def step(self, index: int, lattice: Lattice, stage: _Stage) -> float:
        """Render, compare, and move the Gaussians that were seen; returns the pixels' loss."""
        settings, engine = self._settings, self._engine
        target, correction = self._targets.get(index, lattice), self._corrections.get(index)
        camera = target.camera if correction is None else correction.camera(target.camera)
        background = _BLACK if target.background is None else target.background
        geometry = target.depth is not None
        engine.forward(camera, background, stage.degree, geometry, lattice.dilation_px2)
        loss = self._compare(target, self._observations[index].weight, correction)
        with_alpha = self._supervise(target, self._observations[index].weight, geometry)
        count = max(len(engine), 1)
        engine.step(
            stage.rates,
            settings.opacity_regularization / count,
            settings.scale_regularization / count,
            with_alpha,
            geometry,
        )
        if correction is not None and correction.refines_pose:
            correction.learn_pose(engine.pose_gradient())
        return loss

    def _compare(self, target: Target, weight: float, correction: Correction | None) -> float:
        """The photometric loss; its gradient is left in the engine's planes."""
        engine, (height, width) = self._engine, target.camera.shape
        if target.camera.shape not in self._losses:
            self._losses[target.camera.shape] = PhotometricLoss(height, width)
        exposure = correction if correction is not None and correction.refines_exposure else None
        image = engine.planes[:3]
        shown = image if exposure is None else aligned_copy(exposure.expose(image))
        loss = self._losses[target.camera.shape](
            shown, target.image, self._settings.ssim_weight, engine.gradient_planes, target.weights, weight
        )
        if exposure is not None:
            inside = (slice(None), slice(height), slice(width))
            exposure.learn_exposure(image[inside], engine.gradient_planes[:3][inside])
        return loss

    def _supervise(self, target: Target, weight: float, geometry: bool) -> bool:
        """Add the gradients of alpha and depth to the planes; whether there are any of alpha."""
        height, width = target.camera.shape
        image, planes = (x[:, :height, :width] for x in (self._engine.planes, self._engine.gradient_planes))
        if geometry:
            assert target.depth is not None and target.depth_weight is not None
            _, planes[DEPTH_PLANE], planes[TRANSMITTANCE_PLANE] = depth_gradients(
                image[DEPTH_PLANE],
                1.0 - image[TRANSMITTANCE_PLANE],
                target.camera,
                target.depth,
                weight * target.depth_weight,
                target.normals,
                self._settings,
            )
        if target.opaque is not None:
            if not geometry:
                planes[TRANSMITTANCE_PLANE] = 0.0
            share = np.float32(-self._settings.opaque_weight * weight / target.opaque.size) * target.opaque
            planes[TRANSMITTANCE_PLANE] += share
        return geometry or target.opaque is not None


def _used_degree(asset: SplatAsset) -> int:
    """The highest degree with a coefficient that is not zero."""
    used = np.flatnonzero(asset.sh.any(axis=(0, 2)))
    return int(np.sqrt(used[-1])) if len(used) else 0


def _extent_m(asset: SplatAsset, observations: Sequence[Observation]) -> float:
    """The scene's extent; of the Gaussians when the cameras stand in one place."""
    extent_m = scene_extent_m([view.camera for view in observations])
    if len(asset) == 0:
        return extent_m
    spread_m = float(np.median(np.linalg.norm(asset.means - np.median(asset.means, axis=0), axis=1)))
    return extent_m if extent_m > _ONE_PLACE * spread_m else spread_m


def _shuffled(observations: Sequence[Observation], rng: np.random.Generator) -> Iterator[int]:
    """Indices without end: pass after pass, shuffled, that name every observation ``draws`` times on average.

    One with a fraction comes in some passes once more. Each starts elsewhere in its count (multiples of
    the golden ratio), so that those of one fraction do not all come in the same passes.
    """
    draws = np.array([view.draws for view in observations])
    phases = np.arange(len(draws)) * _GOLDEN_RATIO % 1.0
    for done in itertools.count():
        times = np.floor((done + 1) * draws + phases) - np.floor(done * draws + phases)
        yield from rng.permutation(np.repeat(np.arange(len(draws)), times.astype(int))).tolist()
