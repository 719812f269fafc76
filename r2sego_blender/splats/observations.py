"""What an asset is trained on: images at known cameras, and what else is known there."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from ..cameras import Camera
from ..errors import AssetError
from .lattice import Lattice
from .tiles import planes_of

ImageSource = np.ndarray | Callable[[], np.ndarray]


@dataclass(frozen=True)
class Observation:
    """One image the asset must reproduce.

    ``image`` (H, W, 3) float32 in [0, 1] of the camera's size, or a function that loads it
    each time it is needed; ``weight`` multiplies the image's loss; ``confidence`` (H, W)
    float32 in [0, 1], or a function that loads it, if given, multiplies each pixel's gradient
    (0 masks it out); ``draws`` is how often the image comes in each shuffled pass over all
    observations (oversampling of captures); ``background`` (H, W, 3) float32 is what stands
    behind the Gaussians, black if not given; where ``opaque`` (H, W) float32 is 1, a surface is
    known to be, and the Gaussians must hide what stands behind them.

    ``depth`` (H, W) float32 is planar depth in metres that the asset should have, 0 unknown,
    and ``normals`` (H, W, 3) float32 the surface's unit normals in the camera frame, 0
    unknown; ``depth_confidence`` (H, W) float32 in [0, 1] weighs both. ``refines_exposure``
    and ``refines_pose`` let training correct the image's brightness and the camera's pose, at
    the settings' ``exposure_rate`` and ``pose_rate``: for generated frames, never for captures.
    """

    camera: Camera
    image: ImageSource
    weight: float = 1.0
    confidence: ImageSource | None = None
    draws: int = 1
    background: np.ndarray | None = None
    opaque: np.ndarray | None = None
    depth: np.ndarray | None = None
    normals: np.ndarray | None = None
    depth_confidence: np.ndarray | None = None
    refines_exposure: bool = False
    refines_pose: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.image, np.ndarray):
            self._check("image", self.image, (*self.camera.shape, 3))
        if isinstance(self.confidence, np.ndarray):
            self._check("confidence", self.confidence, self.camera.shape)
        for name in ("opaque", "depth", "depth_confidence"):
            self._check(name, getattr(self, name), self.camera.shape)
        for name in ("background", "normals"):
            self._check(name, getattr(self, name), (*self.camera.shape, 3))
        if self.normals is not None and self.depth is None:
            raise AssetError(
                "an observation has normals but no depth", cure="Give the depth of the same surface."
            )

    def loaded(self) -> np.ndarray:
        """The image. Raises AssetError when a loaded one is not of the camera's size."""
        if isinstance(self.image, np.ndarray):
            return self.image
        image = self.image()
        self._check("image", image, (*self.camera.shape, 3))
        return image

    def loaded_confidence(self) -> np.ndarray | None:
        """The confidence. Raises AssetError when a loaded one is not of the camera's size."""
        if not callable(self.confidence):
            return self.confidence
        confidence = self.confidence()
        self._check("confidence", confidence, self.camera.shape)
        return confidence

    def _check(self, name: str, values: np.ndarray | None, shape: tuple[int, ...]) -> None:
        if values is not None and values.shape != shape:
            raise AssetError(
                f"an observation's {name} has the shape {values.shape}, its camera {self.camera.shape}",
                cure="Scale the image or the camera.",
            )


@dataclass(frozen=True)
class Target:
    """An observation, or some of its pixels, as the loss reads them.

    ``image`` and ``background`` (3, H', W') and ``weights`` (1, H', W') are planes of whole
    tiles; the others are images of the camera's size.
    """

    camera: Camera
    image: np.ndarray
    weights: np.ndarray | None
    background: np.ndarray | None
    opaque: np.ndarray | None
    depth: np.ndarray | None
    normals: np.ndarray | None
    depth_weight: np.ndarray | None

    @property
    def size_bytes(self) -> int:
        arrays = (getattr(self, field.name) for field in fields(self))
        return sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))

    @staticmethod
    def of(view: Observation, with_geometry: bool = True) -> Target:
        """The whole observation, with or without its depth."""
        with_geometry &= view.depth is not None
        return Target(
            camera=view.camera,
            image=planes_of(view.loaded()),
            weights=None if view.confidence is None else planes_of(view.loaded_confidence()),
            background=None if view.background is None else planes_of(view.background),
            opaque=view.opaque,
            depth=view.depth if with_geometry else None,
            normals=view.normals if with_geometry else None,
            depth_weight=_depth_weight(view) if with_geometry else None,
        )

    def at(self, lattice: Lattice) -> Target:
        """What the lattice's pixels show of it."""

        def planes(values: np.ndarray | None) -> np.ndarray | None:
            return None if values is None else lattice.planes(values, self.camera.shape)

        def pixels(values: np.ndarray | None) -> np.ndarray | None:
            return None if values is None else lattice.pixels(values)

        return Target(
            camera=lattice.camera(self.camera),
            image=planes(self.image),
            weights=planes(self.weights),
            background=planes(self.background),
            opaque=pixels(self.opaque),
            depth=pixels(self.depth),
            normals=pixels(self.normals),
            depth_weight=pixels(self.depth_weight),
        )


def _depth_weight(view: Observation) -> np.ndarray:
    known = (view.depth > 0.0).astype(np.float32)
    return known if view.depth_confidence is None else known * view.depth_confidence


class TargetCache:
    """Targets made when they are needed; the ones used longest ago make room for others.

    So memory does not grow with the number of images. Without ``with_geometry`` they have no
    depth and no normals, which only their losses need.
    """

    def __init__(
        self, observations: Sequence[Observation], budget_bytes: int, with_geometry: bool = True
    ) -> None:
        self._observations = observations
        self._with_geometry = with_geometry
        self._budget_bytes = budget_bytes
        self._targets: OrderedDict[int, Target] = OrderedDict()
        self._bytes = 0

    def get(self, index: int) -> Target:
        """The whole observation ``index``."""
        if index in self._targets:
            self._targets.move_to_end(index)
            return self._targets[index]
        target = Target.of(self._observations[index], self._with_geometry)
        self._targets[index] = target
        self._bytes += target.size_bytes
        while self._bytes > self._budget_bytes and len(self._targets) > 1:
            _, oldest = self._targets.popitem(last=False)
            self._bytes -= oldest.size_bytes
        return target
