"""A worker of a person's own, with any model: ``R2SEGO_DEPTH_WORKER`` names its program or its place on this machine.

Task "depth" (docs/backends.md): inputs ``photograph_000`` and on, (H, W, 3) uint8; the parameter ``cameras``, one a
photograph, as ``Camera.to_json``. Outputs ``depth_000``, (H, W) float, planar, in any one unit, not above 0 where
unknown, and if it knows ``sigma_000``, the expected relative error, more than 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field

import numpy as np

from ...captures.capture import Capture
from ...captures.sparse_points import SparsePoints
from ...core.errors import NativeError
from ...core.images import to_uint8
from ...core.progress import SILENT, Progress
from ...workers.protocol.asking import Worker, ask
from ...workers.protocol.named_worker import named_worker
from ...workers.protocol.request import Request
from ...workers.protocol.response import Response
from .estimated_depth import EstimatedDepth

BACKENDS = {"worker": "a worker of one's own"}
ORDER = 7

WORKER_VARIABLE = "R2SEGO_DEPTH_WORKER"
"""Names the worker: this machine's affair, which no bundle from elsewhere decides."""

_CURE = f"Set {WORKER_VARIABLE} to a program that serves depth, or to http://127.0.0.1:PORT, see docs/backends.md."
_FARTHEST = 1e6
_SIGMAS = (1e-3, 1e3)


@dataclass
class Estimator:
    """Asks the worker for all captures at once. ``label`` is what it called itself, with its version."""

    backend: str = "worker"
    progress: Progress = SILENT
    worker: Worker | None = None
    label: str = field(default=BACKENDS["worker"], init=False)

    def estimate(self, captures: Sequence[Capture], sparse: SparsePoints) -> Mapping[str, EstimatedDepth]:
        """See ``backends.DepthEstimator``. A map that is none costs its photograph's estimate and is told.

        Raises MachineError where the worker is not there, NativeError where it broke, or no map is right.
        """
        inputs = {f"photograph_{k:03d}": to_uint8(one.image()) for k, one in enumerate(captures)}
        request = Request("depth", self.backend, {"cameras": [one.camera.to_json() for one in captures]}, inputs)
        found: dict[str, EstimatedDepth] = {}
        failure: NativeError | None = None
        with (
            closing(self.worker or named_worker(WORKER_VARIABLE, "--backend", _CURE)) as worker,
            ask(worker, request, self.progress) as response,
        ):
            self.label = response.backend
            for k, capture in enumerate(captures):
                try:
                    found[capture.name] = _estimate(response, k, capture.camera.shape)
                except NativeError as error:
                    failure = error
                    self.progress.message(f"no estimated depth of {capture.name}: {error}", "warning")
            if failure is not None and not found:
                raise failure
        return found


def _estimate(response: Response, k: int, shape: tuple[int, int]) -> EstimatedDepth:
    """The map of the photograph with this number. Raises NativeError for one that is none, or knows nothing."""
    depth = response.array(f"depth_{k:03d}", shape)
    depth = np.where((depth > 0.0) & (depth <= _FARTHEST), depth, 0.0).astype(np.float32)
    if not (depth > 0.0).any():
        raise response.wrong("knows no depth anywhere")
    sigma = np.ones_like(depth)
    if (name := f"sigma_{k:03d}") in response.files:
        sigma = response.array(name, shape).clip(*_SIGMAS).astype(np.float32)
    return EstimatedDepth(depth, np.where(depth > 0.0, sigma, np.float32(0.0)))
