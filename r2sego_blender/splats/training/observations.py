"""What an asset is trained on: images at known cameras, and what else is known there."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...core.cameras import Camera
from ...core.errors import AssetError
from ...core.images import to_uint8
from ..kernels.tiles import planes_of
from .lattice import Lattice

ImageSource = np.ndarray | Callable[[], np.ndarray]


@dataclass(frozen=True)
class Observation:
    """One image the asset must reproduce.

    ``image`` (H, W, 3) float32 in [0, 1] of the camera's size, or a function that loads it
    each time it is needed; ``weight`` multiplies the image's loss; ``confidence`` (H, W)
    float32 in [0, 1], or a function that loads it, if given, multiplies each pixel's gradient
    (0 masks it out); ``draws``, above 0, is how often the image comes on average in each shuffled
    pass over all observations: the fewer, the less it is learnt from; ``background`` (H, W, 3) float32 is what stands
    behind the Gaussians, black if not given; where ``opaque`` (H, W) float32 is 1, a surface is
    known to be, and the Gaussians must hide what stands behind them.

    ``depth`` (H, W) float32 is planar depth in metres that the asset should have, 0 unknown,
    and ``normals`` (H, W, 3) float32 the surface's unit normals in the camera frame, 0
    unknown; ``depth_confidence`` (H, W) float32 in [0, 1] weighs both. ``refines_exposure``
    and ``refines_pose`` let training correct the image's brightness and the camera's pose, at
    the settings' ``exposure_learning_rate`` and ``pose_learning_rate``: for generated frames,
    never for captures.
    """

    camera: Camera
    image: ImageSource
    weight: float = 1.0
    confidence: ImageSource | None = None
    draws: float = 1.0
    background: np.ndarray | None = None
    opaque: np.ndarray | None = None
    depth: np.ndarray | None = None
    normals: np.ndarray | None = None
    depth_confidence: np.ndarray | None = None
    refines_exposure: bool = False
    refines_pose: bool = False

    def __post_init__(self) -> None:
        if not 0.0 < self.draws < math.inf:
            raise AssetError(
                f"an observation is drawn {self.draws} times", cure="Give a number above 0, or leave it out."
            )
        if isinstance(self.image, np.ndarray):
            self._check("image", self.image, (*self.camera.shape, 3))
        if isinstance(self.confidence, np.ndarray):
            self._check("confidence", self.confidence, self.camera.shape)
        for name in ("opaque", "depth", "depth_confidence"):
            self._check(name, getattr(self, name), self.camera.shape)
        for name in ("background", "normals"):
            self._check(name, getattr(self, name), (*self.camera.shape, 3))
        if self.normals is not None and self.depth is None:
            raise AssetError("an observation has normals but no depth", cure="Give the depth of the same surface.")

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

    @staticmethod
    def of(
        view: Observation,
        lattice: Lattice,
        image: np.ndarray,
        confidence: np.ndarray | None,
        with_geometry: bool = True,
    ) -> Target:
        """What the lattice's pixels show, with or without depth, of an observation.

        ``image`` (H, W, 3) and ``confidence`` (H, W) are its own, loaded; those of uint8 have 255
        where others have 1.
        """
        with_geometry &= view.depth is not None

        def pixels(values: np.ndarray | None) -> np.ndarray | None:
            return None if values is None else lattice.pixels(values)

        def planes(values: np.ndarray | None) -> np.ndarray | None:
            return None if values is None else planes_of(lattice.pixels(values))

        return Target(
            camera=lattice.camera(view.camera),
            image=planes_of(lattice.pixels(image)),
            weights=planes(confidence),
            background=planes(view.background),
            opaque=pixels(view.opaque),
            depth=pixels(view.depth) if with_geometry else None,
            normals=pixels(view.normals) if with_geometry else None,
            depth_weight=_depth_weight(view, lattice) if with_geometry else None,
        )


def _depth_weight(view: Observation, lattice: Lattice) -> np.ndarray:
    assert view.depth is not None
    known = (lattice.pixels(view.depth) > 0.0).astype(np.float32)
    return known if view.depth_confidence is None else known * lattice.pixels(view.depth_confidence)


_Loaded = tuple[np.ndarray, np.ndarray | None]


class Targets:
    """The observations' targets. What must be loaded for them is kept, what was used longest ago
    makes room for more.

    So memory does not grow with the number of images. It is kept in 8 bits, which photographs
    and masks have in their files. Without ``with_geometry`` the targets have no depth and no
    normals, which only their losses need.
    """

    def __init__(self, observations: Sequence[Observation], budget_bytes: int, with_geometry: bool = True) -> None:
        self._observations = observations
        self._with_geometry = with_geometry
        self._budget_bytes = budget_bytes
        self._kept: OrderedDict[int, _Loaded] = OrderedDict()
        self._bytes = 0

    def get(self, index: int, lattice: Lattice) -> Target:
        """What the lattice's pixels show of observation ``index``."""
        view = self._observations[index]
        return Target.of(view, lattice, *self._loaded(index, view), self._with_geometry)

    def _loaded(self, index: int, view: Observation) -> _Loaded:
        """Its image and confidence."""
        if index in self._kept:
            self._kept.move_to_end(index)
            return self._kept[index]
        image = _in_8_bits(view.loaded()) if callable(view.image) else view.image
        confidence = view.loaded_confidence()
        if callable(view.confidence) and confidence is not None:
            confidence = _in_8_bits(confidence)
        loaded = image, confidence
        if callable(view.image) or callable(view.confidence):
            self._kept[index] = loaded
            self._bytes += _size_bytes(loaded)
        while self._bytes > self._budget_bytes and len(self._kept) > 1:
            _, oldest = self._kept.popitem(last=False)
            self._bytes -= _size_bytes(oldest)
        return loaded


def _in_8_bits(values: np.ndarray) -> np.ndarray:
    """The same, in memory channel after channel, as ``planes_of`` takes them soonest."""
    in_8_bits = to_uint8(values)
    if values.ndim == 2:
        return in_8_bits
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(in_8_bits, 2, 0)), 0, 2)


def _size_bytes(loaded: _Loaded) -> int:
    return sum(values.nbytes for values in loaded if values is not None and values.dtype == np.uint8)
