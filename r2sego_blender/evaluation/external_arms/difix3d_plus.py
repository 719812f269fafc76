"""Difix3D+ (Wu et al., CVPR 2025) as the paper has it: the one-step postprocessor of the GaussGym condition's pictures.

Written after github.com/nv-tlabs/Difix3D at c76edc595586e16732c91ddee82f3a6d83a8a9cc. Each picture is fixed with the
photograph as its reference that stands nearest, by that code's own distance (``examples/utils.py``): metres and radians
together. What runs is ``workers.models.difix3d``, in the interpreter that ``R2SEGO_DIFIX3D_PYTHON`` names or
``r2sego backend install difix3d`` made.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...captures.capture import Capture
from ...core.cameras import Camera
from ...core.digests import file_identity
from ...core.images import to_uint8
from ...workers.learned_backends import LEARNED_BACKENDS
from ...workers.models import difix3d as worker_program
from ...workers.protocol.program_worker import ProgramWorker, library_command
from ...workers.protocol.request import Request
from .slot import TASK, Given, Installation

BACKEND = LEARNED_BACKENDS["difix3d"]


def installation() -> Installation:
    """See ``slot.ExternalArm``; whether the environment is complete its worker says when it is asked."""
    command = library_command(BACKEND.interpreter(), f"workers.models.{BACKEND.worker}")
    identity = {"program": file_identity(Path(worker_program.__file__))}
    return Installation(identity, ProgramWorker(command, BACKEND.variable, BACKEND.cure))


def request(given: Given) -> Request:
    """See ``slot.ExternalArm``: each view's rendering, and the photograph that it is fixed with."""
    inputs: dict[str, np.ndarray | Path] = {}
    for number, (name, camera) in enumerate(given.cameras.items()):
        reference = given.captures[nearest(camera, given.captures)]
        inputs[f"rendering_{number:03d}"] = to_uint8(given.renderings[name])
        inputs[f"reference_{number:03d}"] = to_uint8(reference.image())
    return Request(TASK, BACKEND.name, inputs=inputs)


def nearest(camera: Camera, captures: Sequence[Capture]) -> int:
    """The capture that a rendering is fixed with: the least of metres apart and radians of the turn between, summed."""

    def apart(capture: Capture) -> float:
        turn = capture.camera.world_from_camera[:3, :3].T @ camera.world_from_camera[:3, :3]
        angle = np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0))
        return float(np.linalg.norm(capture.camera.centre - camera.centre) + angle)

    return min(range(len(captures)), key=lambda index: apart(captures[index]))
