"""VGGT as the registrar, the paper's: a frame's pose relative to its fixed reference, composed with that one's.

The reference, the frame and the captures that see most of it are processed together (Sec. 3.3). Of what VGGT says
only the frame's pose relative to the reference is used, composed with the reference's registered world pose: no
capture's pose is replaced. Its unit is its own; the reference's known depth by VGGT's depth of the reference is the
metres of one. A baseline to another capture would tell it too, but by two poses that are each off by centimetres,
where the depth has thousands of pixels, and needs that other capture. The focal length is the query's until it is
refined.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ...captures.capture import Capture
from ...config.settings import RegistrationSettings, Settings
from ...core.cameras import Camera
from ...core.digests import file_identity
from ...core.statistics import weighted_median
from ...geometry.estimators.learned import Seen
from ...geometry.estimators.placement import Placement
from ...geometry.estimators.vggt import Estimator
from ...workers.learned_backends import LEARNED_BACKENDS
from ...workers.models import vggt as worker_program
from ...workers.protocol.asking import Worker, ask
from ...workers.protocol.program_worker import ProgramWorker, library_command
from ...workers.protocol.request import Request
from ...workers.protocol.response import Response
from .frame_registration import composed
from .landmarks import Landmarks
from .slot import Installation, Registrar

BACKENDS = {"vggt": "VGGT"}
ORDER = 1

_TASK = "registration"
_LARGEST_OFF = 0.25  # median relative error; depth that is off by more is of something else
_LEAST_KNOWN = 0.01  # share of the reference's pixels whose depth both know
_FARTHEST_M = 100.0  # from the reference; beyond it is no room


class VGGTRegistrar:
    """Asks a worker, as ``geometry.estimators.vggt`` does, for the pose of each frame relative to its reference.

    The first picture of a request is the reference, the second the frame, the others are of further captures.
    """

    def __init__(self, worker: Worker, captures: Sequence[Capture], count: int) -> None:
        """``count``: how many of the ``captures`` are shown with a frame, its reference among them."""
        self.name = BACKENDS["vggt"]
        self._model = Estimator("vggt", worker=worker)
        self._worker, self._captures, self._count = worker, captures, count

    def start(self, image: np.ndarray, query: Camera, reference: int, landmarks: Landmarks) -> Camera | None:
        """See ``Registrar``. Raises NativeError for an answer that is none, or of another place."""
        fixed = self._captures[reference].camera
        seen_best = landmarks.indices_seen_best(query, fixed, self._count)
        others = [self._captures[index].image() for index in seen_best if index != reference]
        images = [self._captures[reference].image(), image, *others]
        places = self._model.placements([(one.shape[1], one.shape[0]) for one in images])
        pictures = np.stack([place.picture(one) for place, one in zip(places, images, strict=True)])
        with ask(self._worker, Request(_TASK, "vggt", inputs={"pictures": pictures})) as response:
            seen = self._model.read(response, places)
            self.name = response.backend
            reference_from_frame = _relative(response, *seen[:2])
            working = places[0].photographs(fixed)
            known = landmarks.surfaces[reference].seen_from(working).depth
            reference_from_frame[:3, 3] *= _metres(response, seen[0], places[0], working, known)
            far_m = float(np.linalg.norm(reference_from_frame[:3, 3]))
            if far_m > _FARTHEST_M:
                raise response.wrong(f"placed the frame {far_m:.3g} m from its reference")
        return composed(fixed, query.at(reference_from_frame))


def _relative(response: Response, reference: Seen, frame: Seen) -> np.ndarray:
    """(4, 4) float64: the frame's camera in the reference's frame, lengths in the answer's unit."""
    if reference.camera is None or frame.camera is None:
        raise response.wrong("gave a pose that is not a rotation and a translation, or a lens that sees nothing")
    relative: np.ndarray = reference.camera.camera_from_world @ frame.camera.world_from_camera
    return relative


def _metres(response: Response, seen: Seen, place: Placement, camera: Camera, known: np.ndarray) -> float:
    """Metres of the answer's unit: the median of ``known`` (H, W), 0 unknown, by what is ``seen``, by confidence.

    Both are of the reference's ``camera``.
    """
    depth, confidence = place.depth(seen.depth, camera), np.ones(camera.shape, np.float32)
    if seen.confidence is not None:
        confidence = np.maximum(place.nearest(seen.confidence, camera), 0.0)
    both = (known > 0.0) & (depth > 0.0) & (confidence > 0.0)
    if both.mean() < _LEAST_KNOWN:
        raise response.wrong("knows no depth of the reference where the captures do")
    ratio = np.log(known[both].astype(np.float64) / depth[both])
    scale = weighted_median(ratio, confidence[both])
    off = weighted_median(np.abs(ratio - scale), confidence[both])
    if off > _LARGEST_OFF:
        raise response.wrong(f"gave depth of the reference that is off by {off:.0%}")
    return float(np.exp(scale))


def installation(name: str, settings: RegistrationSettings) -> Installation:
    """VGGT in its own environment, known by the worker's program and by which of its weights are there.

    Raises MachineError where no environment is set up; whether it is complete its worker says when it is asked.
    """
    known = LEARNED_BACKENDS["vggt"]
    command = library_command(known.interpreter(), f"workers.models.{known.worker}")
    identity = {"program": file_identity(Path(worker_program.__file__)), "weights": _weights()}
    return Installation(identity, ProgramWorker(command, known.label, known.cure))


def _weights() -> str:
    """The revision that Hugging Face's cache has of the weights, "" where it has none."""
    home = os.environ.get("HF_HOME") or Path("~/.cache/huggingface").expanduser()
    cache = os.environ.get("HF_HUB_CACHE") or Path(home, "hub")
    folder = Path(cache, f"models--{worker_program.REPOSITORY.replace('/', '--')}")
    with contextlib.suppress(FileNotFoundError):
        return file_identity(folder / "refs" / "main")
    return ""


@contextlib.contextmanager
def make(installed: Installation, captures: Sequence[Capture], settings: Settings) -> Iterator[Registrar]:
    """VGGT, asked through files; its program ends with the context."""
    try:
        yield VGGTRegistrar(installed.worker, captures, settings.registration.max_captures)
    finally:
        installed.worker.close()
