"""GenFusion (Wu et al., CVPR 2025): a reconstruction of its own from the same captures, poses and observed points.

Written after github.com/Inception3D/GenFusion at 642312c6478fc9892018dd7265f7bd390eee0c34. Its ``train.py`` trains 2D
Gaussians, and a video diffusion model mends what they show along paths of its own; its ``render.py`` shows the views.
Settings are those that it publishes for six views (``genfusion_scripts/batch_sparse.py``), with the common number of
steps, of which its stages keep their shares. It makes some 80 frames a stage, more than the paper's 36 in all: nothing
in it limits them. What runs is ``workers.models.genfusion``, in the interpreter that ``R2SEGO_GENFUSION_PYTHON`` names,
on the repository in ``R2SEGO_GENFUSION_REPOSITORY``.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...core.cameras import Camera
from ...core.digests import file_identity
from ...core.errors import MachineError
from ...core.images import to_uint8
from ...workers.learned_backends import LEARNED_BACKENDS
from ...workers.models import genfusion as worker_program
from ...workers.protocol.program_worker import ProgramWorker, library_command
from ...workers.protocol.request import Request
from .slot import TASK, Given, Installation

BACKEND = LEARNED_BACKENDS["genfusion"]
REPOSITORY_VARIABLE = BACKEND.needs[0]
CHECKPOINT_VARIABLE = "R2SEGO_GENFUSION_CHECKPOINT"
"""Names the weights; without it they are where the repository's own scripts have them."""


def installation() -> Installation:
    """See ``slot.ExternalArm``."""
    python = BACKEND.interpreter()
    repository = Path(os.environ.get(REPOSITORY_VARIABLE) or os.devnull).resolve()
    place = repository / worker_program.FOLDER
    for file in worker_program.FILES:
        if not (place / file).is_file():
            what = f"{REPOSITORY_VARIABLE} names no folder with {worker_program.FOLDER}/{file}"
            raise MachineError(what, where=REPOSITORY_VARIABLE, cure=BACKEND.cure)
    checkpoint = Path(os.environ.get(CHECKPOINT_VARIABLE) or place / worker_program.CHECKPOINT).resolve()
    if not checkpoint.is_file():
        raise MachineError(f"the weights of {BACKEND.label} are not there", where=checkpoint, cure=BACKEND.cure)
    identity = {
        "program": file_identity(Path(worker_program.__file__)),
        "checkpoint": file_identity(checkpoint),
        "repository": [file_identity(place / file) for file in worker_program.FILES],
    }
    command = library_command(python, "workers.models.genfusion", str(repository), str(checkpoint))
    return Installation(identity, ProgramWorker(command, BACKEND.variable, BACKEND.cure))


def request(given: Given) -> Request:
    """See ``slot.ExternalArm``: photographs, cameras and points, as arrays."""
    photographs = {
        f"photograph_{number:03d}": to_uint8(capture.image()) for number, capture in enumerate(given.captures)
    }
    observed = given.observed
    arrays = {
        **_cameras("capture", [capture.camera for capture in given.captures]),
        **_cameras("view", [*given.cameras.values()]),
        "points": observed.points.astype(np.float64),
        "colours": to_uint8(observed.colours),
        "visibility": observed.visibility,
    }
    return Request(TASK, BACKEND.name, {"steps": given.steps}, {**photographs, **arrays})


def _cameras(kind: str, cameras: Sequence[Camera]) -> dict[str, np.ndarray]:
    """Sizes (n, 2) width and height, lenses (n, 4) fx fy cx cy of pixel centres at half-integers, poses (n, 4, 4)."""
    return {
        f"{kind}_sizes": np.array([(one.width, one.height) for one in cameras]),
        f"{kind}_lenses": np.array([(one.fx, one.fy, one.cx, one.cy) for one in cameras]),
        f"{kind}_poses": np.stack([one.camera_from_world for one in cameras]),
    }
