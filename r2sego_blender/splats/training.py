"""Training of a splat asset on registered images (Algorithm 1, the asset's update).

The number of Gaussians is fixed: the budget is spent by the initialisation, so there is
no densification and no opacity reset.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..cameras import Camera
from ..errors import AssetError
from ..images import resize
from ..progress import SILENT, Progress
from ..settings import TrainingSettings
from .adam import Adam
from .asset import SplatAsset
from .loss import PhotometricLoss
from .rasterizer import Gradients, Rasterizer

_BLACK = (0.0, 0.0, 0.0)

_SCENE_MARGIN = 1.1
"""3DGS: a scene's extent is this times the largest distance of a camera from their middle."""


@dataclass(frozen=True)
class Observation:
    """One image the asset must reproduce.

    ``image`` (H, W, 3) float32 in [0, 1] of the camera's size; ``weight`` multiplies the
    image's loss; ``confidence`` (H, W) float32 in [0, 1], if given, multiplies each pixel's
    gradient; ``draws`` is how often the image comes in each shuffled pass over all
    observations (oversampling of captures); ``background`` (H, W, 3) float32 is what stands
    behind the Gaussians, black if not given; where ``opaque`` (H, W) float32 is 1, a surface
    is known to be, and the Gaussians must hide what stands behind them.
    """

    camera: Camera
    image: np.ndarray
    weight: float = 1.0
    confidence: np.ndarray | None = None
    draws: int = 1
    background: np.ndarray | None = None
    opaque: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.image.shape != (*self.camera.shape, 3):
            raise AssetError(
                f"an observation's image has the shape {self.image.shape}, its camera {self.camera.shape}",
                cure="Scale the image or the camera.",
            )
        if self.confidence is not None and self.confidence.shape != self.camera.shape:
            raise AssetError(
                f"an observation's confidence has the shape {self.confidence.shape}, "
                f"its camera {self.camera.shape}", cure="Give one number for each pixel.",
            )  # fmt: skip

    def scaled(self, factor: float) -> Observation:
        """The observation with ``factor`` times the pixels a side."""
        camera = self.camera.scaled(factor)

        def resized(values: np.ndarray | None) -> np.ndarray | None:
            if values is None:
                return None
            return np.ascontiguousarray(resize(np.asarray(values, np.float32), camera.width, camera.height))

        return Observation(
            camera, resized(self.image), self.weight, resized(self.confidence), self.draws,
            resized(self.background), resized(self.opaque),
        )  # fmt: skip


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
) -> SplatAsset:
    """A new asset that reproduces ``observations`` better than ``asset`` after ``steps`` steps.

    The first ``settings.half_resolution_share`` of the steps runs at half resolution. The
    harmonics' degree starts at the highest the asset already uses and rises by one at
    equal intervals. The same inputs and generator state give the
    same bits, for any number of threads. Raises AssetError without observations, or with
    more Gaussians than ``settings.max_gaussians``.
    """
    if not observations:
        raise AssetError("there is no observation to train on", cure="Give at least one registered image.")
    if len(asset) > settings.max_gaussians:
        raise AssetError(
            f"the asset has {len(asset)} Gaussians, more than {settings.max_gaussians}",
            cure="Raise training.max_gaussians or initialise with fewer.",
        )
    degree = _used_degree(asset)
    asset = asset.with_degree(settings.sh_degree).copy()
    schedule = _Schedule(settings, steps, degree, _extent_m(asset, observations))
    trainer = _Trainer(asset, settings)
    draws = _shuffled(observations, rng)
    half = [view.scaled(0.5) for view in observations] if schedule.half_steps else []
    full = [view.scaled(1.0) for view in observations]
    with progress.task(title, steps) as task:
        for step in range(steps):
            view = (half if step < schedule.half_steps else full)[next(draws)]
            trainer.step(view, schedule.rates(step), schedule.degree(step))
            task.advance()
    return asset


class _Schedule:
    """Learning rates and harmonics' degree by step."""

    def __init__(self, settings: TrainingSettings, steps: int, degree: int, position_scale: float) -> None:
        self._settings = settings
        self._steps = steps
        self._first_degree = degree
        self._position_scale = position_scale
        self.half_steps = round(steps * settings.half_resolution_share)

    def degree(self, step: int) -> int:
        """One more at each of equal intervals, from the first degree to the highest."""
        raises = self._settings.sh_degree - self._first_degree
        return self._first_degree + step * (raises + 1) // self._steps

    def rates(self, step: int) -> dict[str, float]:
        """The learning rates; the means' decays exponentially (Kerbl et al. 2023)."""
        settings = self._settings
        decay = settings.position_decay ** (step / self._steps)
        return {
            "means": settings.position_rate * self._position_scale * decay,
            "log_scales": settings.scale_rate,
            "quaternions": settings.rotation_rate,
            "logit_opacities": settings.opacity_rate,
            "sh": settings.colour_rate,
            "sh_rest": settings.colour_rate * settings.harmonics_rate_ratio,
        }


class _Trainer:
    """One optimisation step after the other, on buffers that are kept."""

    def __init__(self, asset: SplatAsset, settings: TrainingSettings) -> None:
        self._asset = asset
        self._settings = settings
        self._gradients = Gradients.of(asset)
        self._adam = Adam(asset)
        self._rasterizer = Rasterizer()
        self._losses: dict[tuple[int, int], PhotometricLoss] = {}
        self._zeros: dict[tuple[int, int], np.ndarray] = {}

    def step(self, view: Observation, rates: dict[str, float], degree: int) -> float:
        """Render, compare, and move the Gaussians that were seen; returns the loss."""
        shape = view.camera.shape
        if shape not in self._losses:
            self._losses[shape] = PhotometricLoss(*shape)
            self._zeros[shape] = np.zeros(shape, np.float32)
        background = _BLACK if view.background is None else view.background
        self._rasterizer.forward(self._asset, view.camera, background, degree)
        loss, gradient = self._losses[shape](self._rasterizer.colour, view.image, self._settings.ssim_weight)
        if view.confidence is not None:
            gradient *= (view.confidence * np.float32(view.weight))[..., None]
        elif view.weight != 1.0:
            gradient *= np.float32(view.weight)
        zeros = self._zeros[shape]
        alpha_gradient = zeros
        if view.opaque is not None:
            share = np.float32(-self._settings.opaque_weight * view.weight / view.opaque.size)
            alpha_gradient = share * view.opaque
        self._rasterizer.backward(gradient, alpha_gradient, zeros, self._gradients)
        self._adam.step(self._gradients, rates, degree)
        return loss


def _used_degree(asset: SplatAsset) -> int:
    """The highest degree with a coefficient that is not zero."""
    used = np.flatnonzero(asset.sh.any(axis=(0, 2)))
    return int(np.sqrt(used[-1])) if len(used) else 0


def _extent_m(asset: SplatAsset, observations: Sequence[Observation]) -> float:
    """The scene's extent; of the Gaussians when the cameras stand in one place."""
    extent_m = scene_extent_m([view.camera for view in observations])
    if extent_m > 0.0 or len(asset) == 0:
        return extent_m
    return float(np.median(np.linalg.norm(asset.means - np.median(asset.means, axis=0), axis=1)))


def _shuffled(observations: Sequence[Observation], rng: np.random.Generator) -> Iterator[int]:
    """Indices without end: each pass names every observation ``draws`` times."""
    indices = np.repeat(np.arange(len(observations)), [max(1, view.draws) for view in observations])
    while True:
        yield from rng.permutation(indices).tolist()
