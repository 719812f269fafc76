"""What a method of others shows of the frozen views, kept in the bundle as other results are."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType, ModuleType

import numpy as np

from ...bundle.artifacts import Artifact
from ...bundle.runner import Runner
from ...bundle.scene import Scene
from ...captures.capture import Capture
from ...captures.store import CAPTURES
from ...core.arrays import opened_arrays, require_shapes, save_arrays
from ...core.cameras import Camera
from ...core.errors import EvaluationError, MachineError
from ...core.printable import printable
from ...core.progress import SILENT, Progress
from ...geometry.stereo.observed_geometry import OBSERVED, ObservedGeometry
from ...splats.artifacts import REFINED_ASSET
from ...splats.asset import SplatAsset
from ...workers.protocol.asking import ask
from ...workers.protocol.response import Limits, Response
from ..arms import ARMS, DIFIX3D_PLUS, GENFUSION
from ..exposure.exposures import Exposures
from . import difix3d_plus, genfusion
from .slot import ExternalArm, Given

METHODS: Mapping[str, ExternalArm | ModuleType] = {DIFIX3D_PLUS: difix3d_plus, GENFUSION: genfusion}
"""The methods by their arm."""

_DIGITS, _LONGEST_NAME = 12, 200  # of a digest that is shown, of a backend's name
_DIGITS_OF_EXPOSURE = 4  # beyond which the same views are asked for
_LIMITS = Limits(seconds=86_400.0, silent_s=3600.0)


@dataclass(frozen=True)
class ExternalViews:
    """Pictures of the frozen views, (H, W, 3) float32 in [0, 1] by name.

    ``backend`` is what its worker said made them, ``weights`` the SHA-256 of the model's.
    """

    backend: str
    weights: str
    pictures: Mapping[str, np.ndarray]

    @property
    def told(self) -> str:
        """What made the pictures, for people."""
        return f"{self.backend}, weights {self.weights[:_DIGITS]}" if self.weights else self.backend

    def at(self, views: Sequence[Capture]) -> Callable[[Camera], np.ndarray]:
        """Gives the picture of each of the ``views`` for its camera."""
        by_camera = {id(view.camera): self.pictures[view.name] for view in views}
        return lambda camera: by_camera[id(camera)]

    def save(self, file: Path) -> None:
        """Write the pictures, 8 bits a colour, as an uncompressed ``.npz``."""
        named = {
            f"view_{number:03d}": np.rint(picture * 255.0).astype(np.uint8)
            for number, picture in enumerate(self.pictures.values())
        }
        save_arrays(file, names=np.array([*self.pictures]), backend=self.backend, weights=self.weights, **named)

    @staticmethod
    def load(file: Path) -> ExternalViews:
        """Read what ``save`` wrote. Raises EvaluationError when the file is none of it."""
        what, cure = "these are no pictures of frozen views", "Run `r2sego evaluate` again."
        with opened_arrays(file, EvaluationError, what, cure) as data:
            names, *told = (data[name] for name in ("names", "backend", "weights"))
            if any(text.dtype.kind != "U" for text in (names, *told)) or names.ndim != 1:
                raise ValueError("its names are no words")
            pictures = {}
            for number, name in enumerate(names.tolist()):
                picture = data[f"view_{number:03d}"]
                require_shapes({"view": picture}, view="H W 3")
                if picture.dtype != np.uint8:
                    raise ValueError("a picture has not eight bits a colour")
                pictures[name] = picture.astype(np.float32) / 255.0
            backend, weights = (printable(str(text), _LONGEST_NAME) for text in told)
            return ExternalViews(backend, weights, MappingProxyType(pictures))


def why_not_set_up(arm: str) -> str:
    """What ``arm`` lacks on this machine, '' where it can be asked; nothing is run for it."""
    try:
        METHODS[arm].installation().worker.close()
    except MachineError as error:
        return str(error)
    return ""


def external_views(
    scene: Scene, arm: str, views: Sequence[Capture], exposures: Exposures, progress: Progress = SILENT
) -> ExternalViews:
    """What ``arm`` shows of the ``views``, of which it is given the cameras; passed over while nothing has changed.

    Raises MachineError where the method is not set up, NativeError where it broke or answered nonsense.
    """
    source, method = ARMS[arm], METHODS[arm]
    installed = method.installation()
    h = scene.declaration.settings
    cameras = {view.name: view.camera for view in views}
    steps = h.rounds * h.training.steps_per_round

    def compute(captures: Sequence[Capture], observed: ObservedGeometry, *base: SplatAsset) -> ExternalViews:
        shown = [exposures.renderer(asset) for asset in base]
        renderings = {name: show(camera).colour for show in shown for name, camera in cameras.items()}
        request = method.request(Given(captures, observed, cameras, renderings, steps))
        with ask(installed.worker, request, progress, _LIMITS) as response:
            return ExternalViews(response.backend, response.weights, _pictures(response, cameras))

    made = Artifact(source.views, ExternalViews.load, ExternalViews.save, editable=False)
    base = [_asset_of(source.base)] if source.base else []
    known = [installed.identity, steps, {name: camera.to_json() for name, camera in cameras.items()}]
    if exposures.differ:
        known.append([exposures.of(camera).round(_DIGITS_OF_EXPOSURE).tolist() for camera in cameras.values()])
    try:
        Runner(scene).make(made, compute, CAPTURES, OBSERVED, *base, settings=known)
    finally:
        installed.worker.close()
    return scene.read(made)


def _asset_of(arm: str) -> Artifact[SplatAsset]:
    return Artifact(ARMS[arm].asset, REFINED_ASSET.load)


def _pictures(response: Response, cameras: Mapping[str, Camera]) -> dict[str, np.ndarray]:
    pictures = {}
    for number, (name, camera) in enumerate(cameras.items()):
        picture = response.array(f"view_{number:03d}", (camera.height, camera.width, 3), "u")
        if picture.dtype != np.uint8:
            raise response.wrong(f"gave view_{number:03d} as {picture.dtype}, not as uint8")
        pictures[name] = picture.astype(np.float32) / 255.0
    return pictures
