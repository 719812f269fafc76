"""What learned estimators have in common: pictures of the photographs, a request for those of a size, depth again."""

from __future__ import annotations

import abc
import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ...captures.capture import Capture
from ...captures.sparse_points import SparsePoints
from ...core.cameras import Camera, is_rigid
from ...core.errors import GeometryError, NativeError, R2SEgoError
from ...core.progress import SILENT, Progress
from ...workers.learned_backends import LEARNED_BACKENDS
from ...workers.protocol.asking import Worker, ask
from ...workers.protocol.program_worker import ProgramWorker, library_command
from ...workers.protocol.request import Request
from ...workers.protocol.response import Response
from .estimated_depth import EstimatedDepth
from .placement import Placement

MAP = (None, None)
"""The shape of an answer that has a value a pixel of the picture."""

_SUREST = 1e-3  # a relative sigma: no confidence is taken for more


@dataclass(frozen=True)
class Seen:
    """What a model says of one picture, in this project's conventions.

    ``depth`` (h, w) float planar, in the model's unit; what is not above 0 and finite is not valid.
    ``confidence`` (h, w) float above 0, to which the expected relative error is inverse, None where a model
    has none. ``camera``: the picture's as the model found it, in a frame and unit of its own, None where
    it finds none.
    """

    depth: np.ndarray
    confidence: np.ndarray | None = None
    camera: Camera | None = None


def estimate_of(capture: Capture, placement: Placement, seen: Seen) -> EstimatedDepth | None:
    """The depth of ``capture`` by what was said of its picture; None where nothing valid was."""
    camera = placement.photographs(capture.camera)
    depth = placement.depth(seen.depth, camera)
    sigma = np.ones(camera.shape, np.float32)
    if seen.confidence is not None:
        confidence = placement.nearest(seen.confidence, camera)
        usable = np.isfinite(confidence) & (confidence > 0.0)
        depth = np.where(usable, depth, np.float32(0.0))
        sigma = (1.0 / np.where(usable, confidence, 1.0).clip(1e-6, 1.0 / _SUREST)).astype(np.float32)
    if not (depth > 0.0).any():
        return None
    return EstimatedDepth(depth, np.where(depth > 0.0, sigma, np.float32(0.0)))


def inverted(pose: np.ndarray) -> np.ndarray:
    """(4, 4) float64, the inverse of a rigid pose (3, 4) or (4, 4)."""
    rotation, shift = pose[:3, :3].astype(np.float64), pose[:3, 3].astype(np.float64)
    inverse = np.eye(4)
    inverse[:3, :3], inverse[:3, 3] = rotation.T, -rotation.T @ shift
    return inverse


def camera_found(matrix: np.ndarray, world_from_camera: np.ndarray, placement: Placement) -> Camera | None:
    """A picture's camera by a model's intrinsics (3, 3), pixel centres at half-integers, and its pose (4, 4).

    None where they are no camera.
    """
    if not (np.isfinite(matrix).all() and np.isfinite(world_from_camera).all() and is_rigid(world_from_camera)):
        return None
    fx, fy, cx, cy = (float(matrix[place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2)))
    try:
        return Camera(placement.width, placement.height, fx, fy, cx, cy, world_from_camera).checked()
    except ValueError:
        return None


@dataclass
class LearnedEstimator(abc.ABC):
    """A model that a worker runs; ``backend`` is its name in the slot.

    ``worker``: who is asked instead of the model in its own environment. ``label``: what it called itself,
    with its version; "" before. ``answers``: what comes of a request, by name, with the shape of a picture's.
    """

    backend: str
    progress: Progress = SILENT
    worker: Worker | None = None
    label: str = field(default="", init=False)

    most_views: ClassVar[int] = 32  # of one request: memory grows with them
    answers: ClassVar[Mapping[str, tuple[int | None, ...]]]

    @abc.abstractmethod
    def placements(self, sizes: Sequence[tuple[int, int]]) -> list[Placement]:
        """How photographs of these (width, height) lie in the model's pictures."""

    @abc.abstractmethod
    def request(self, captures: Sequence[Capture], placements: Sequence[Placement]) -> dict[str, np.ndarray]:
        """What the worker is told beside ``pictures`` (n, height, width, 3) uint8, in the model's conventions."""

    @abc.abstractmethod
    def seen(self, said: Mapping[str, np.ndarray], placements: Sequence[Placement]) -> list[Seen]:
        """What ``answers`` say of each picture, in this project's conventions."""

    def estimate(self, captures: Sequence[Capture], sparse: SparsePoints) -> Mapping[str, EstimatedDepth]:
        """See ``backends.DepthEstimator``. A request that fails costs its photographs' estimates and is told.

        Raises the last failure where no photograph has an estimate.
        """
        found: dict[str, EstimatedDepth] = {}
        failure: R2SEgoError | None = None
        placements = self.placements([(one.camera.width, one.camera.height) for one in captures])
        with self._worker() as worker:
            for group in _requests(placements, self.most_views):
                members, places = [captures[index] for index in group], [placements[index] for index in group]
                pictures = np.stack([place.picture(one.image()) for one, place in zip(members, places, strict=True)])
                inputs = {"pictures": pictures, **self.request(members, places)}
                try:
                    with ask(worker, Request("depth", self.backend, inputs=inputs), self.progress) as response:
                        said = self.read(response, places)
                except NativeError as error:
                    failure = error
                    names = ", ".join(one.name for one in members)
                    self.progress.message(f"no estimated depth of {names}: {error}", "warning")
                    continue
                for capture, place, seen in zip(members, places, said, strict=True):
                    estimate = estimate_of(capture, place, seen)
                    if estimate is not None:
                        found[capture.name] = estimate
        if not found:
            raise failure or GeometryError("the model found no depth in any photograph", where=self.backend)
        return found

    def read(self, response: Response, placements: Sequence[Placement]) -> list[Seen]:
        """What a response says of each picture. Raises NativeError for one of another shape."""
        place = placements[0]
        said = {}
        for name, shape in self.answers.items():
            sides = zip(shape, (place.height, place.width, 3), strict=False)
            said[name] = response.array(name, (len(placements), *(own or side for own, side in sides)))
        self.label = response.backend
        return self.seen(said, placements)

    @contextlib.contextmanager
    def _worker(self) -> Iterator[Worker]:
        """Who is asked. Raises MachineError where the model is not set up."""
        if self.worker is not None:
            yield self.worker
            return
        known = LEARNED_BACKENDS[self.backend]
        command = library_command(known.interpreter(), f"workers.models.{known.worker}")
        with ProgramWorker(command, known.label, known.cure) as worker:
            yield worker


def _requests(placements: Sequence[Placement], most: int) -> list[list[int]]:
    """Indices of those whose pictures have one size, in their order, ``most`` at once."""
    groups: dict[tuple[int, int], list[int]] = {}
    for index, place in enumerate(placements):
        groups.setdefault((place.width, place.height), []).append(index)
    return [group[start : start + most] for group in groups.values() for start in range(0, len(group), most)]
