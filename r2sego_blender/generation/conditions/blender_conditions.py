"""Structural conditions rendered in a Blender process, with Cycles or EEVEE."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...core.cameras import Camera
from ...core.errors import GenerationError
from ...core.scratch import ScratchFolder
from ...geometry.proxy.proxy import GeometryProxy
from ...workers.blender_renderer import BLENDER_VARIABLE, BlenderWorker, shared_worker
from .conditions import NOTHING, Condition, Renderer

BACKENDS = {"cycles": "embedded: Cycles", "eevee": "embedded: EEVEE"}
ORDER = 1

_ENGINES = {"cycles": "Cycles", "eevee": "EEVEE"}


def make(name: str, proxy: GeometryProxy) -> Renderer:
    """The renderer of ``proxy`` in the Blender that ``R2SEGO_BLENDER`` names, else in pip's bpy.

    Raises MachineError when it is not there.
    """
    return BlenderRenderer(proxy, name, shared_worker(os.environ.get(BLENDER_VARIABLE, "")))


class BlenderRenderer:
    """Renders conditions in a Blender process that stays, with Cycles or EEVEE.

    Blender reads the proxy once, with the first path.
    """

    def __init__(self, proxy: GeometryProxy, engine: str, worker: BlenderWorker) -> None:
        """``engine`` is "cycles" or "eevee". Raises MachineError when Blender cannot be started."""
        self._engine, self._worker = engine, worker
        self._folder = ScratchFolder()
        self._proxy_file = Path(self._folder.name, "proxy.npz")
        proxy.save(self._proxy_file)
        self.name = f"{_ENGINES[engine]} {worker.version}"

    def render(self, path: Sequence[Camera]) -> list[Condition]:
        """See ``Renderer``. Raises GenerationError or NativeError when Blender cannot."""
        with ScratchFolder() as folder:
            files = self._worker.render(self._proxy_file, path, self._engine, Path(folder))
            return [read_condition(file, camera) for file, camera in zip(files, path, strict=True)]


def read_condition(file: Path, camera: Camera) -> Condition:
    """The condition in a multilayer EXR that ``bridge.conditions`` wrote for ``camera``.

    Raises GenerationError when the file is damaged, or of another size.
    """
    import OpenEXR

    try:
        # ViewLayer.Normal.R: the layer, the pass and its component as this Blender calls it.
        with OpenEXR.File(str(file), separate_channels=True) as image:
            channels = {name.partition(".")[2]: c.pixels for name, c in image.channels().items()}
        provenance = channels["Provenance.X"]
        if provenance.shape != camera.shape:
            raise ValueError(f"its size is {provenance.shape[1]} x {provenance.shape[0]}")
        seen = provenance > NOTHING
        normal = np.stack([channels[f"Normal.{axis}"] for axis in "RGB"], axis=-1)
        return Condition(
            camera=camera,
            depth=np.where(seen, channels["Depth.Z"], np.float32(0.0)),
            normal=_unit(np.where(seen[..., None], normal, np.float32(0.0))),
            provenance=provenance.astype(np.uint8),
            validity=np.where(seen, channels["Validity.X"], np.float32(0.0)),
            instance=np.where(seen, channels["Instance.X"], 0.0).astype(np.int32),
        )
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise GenerationError(
            f"this is not a rendered condition: {error}", where=file, cure="Render it again."
        ) from error


def _unit(normal: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    return normal / np.where(length > 0.0, length, np.float32(1.0))
