"""SAM 3D Objects (Meta, 2025), the paper's source of shape priors, in its own environment.

One photograph and the mask of an object in it in, the object's whole mesh out, in a frame of
its own; where it stands is found by alignment like any other mesh's. Only the published
interface is used: ``Inference`` of the repository's ``notebook/inference.py``, called with
image, mask and seed. It needs Linux, an NVIDIA GPU of 32 GB, and weights that are given on
request, under a licence of their own; it runs in the interpreter that the environment
variable ``R2SEGO_SAM3D_PYTHON`` names, on the repository in ``R2SEGO_SAM3D_REPOSITORY``.

What runs there is ``workers.models.sam3d``, asked for the task "mesh": inputs ``photograph_000``, (H, W, 3) uint8, and
``mask_000``, (H, W) bool, of every object; the parameter ``seed``; outputs ``mesh_000``, binary glTF, of those that
have a mesh.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.errors import MachineError
from .external_environment import named_python
from .learned_backends import LEARNED_BACKENDS
from .models.sam3d import PIPELINE
from .protocol.asking import ask
from .protocol.program_worker import ProgramWorker, library_command
from .protocol.request import Request
from .protocol.response import Limits

if TYPE_CHECKING:
    import numpy as np

PYTHON_VARIABLE = LEARNED_BACKENDS["sam3d"].variable
REPOSITORY_VARIABLE = "R2SEGO_SAM3D_REPOSITORY"
_NAME = "SAM 3D Objects"
_LIMITS = Limits(seconds=4 * 3600.0, silent_s=4 * 3600.0)
_CURE = (
    f"Set up github.com/facebookresearch/sam-3d-objects with its weights in {PIPELINE.parent.as_posix()}, set "
    f"{PYTHON_VARIABLE} to its environment's python and {REPOSITORY_VARIABLE} to its folder, or give a mesh: "
    "--mesh NAME=FILE."
)


def generate_shapes_externally(
    pictures: Mapping[str, tuple[np.ndarray, np.ndarray]], folder: Path, seed: int = 0
) -> tuple[str, dict[str, Path]]:
    """The backend with its version, and the mesh files it wrote into ``folder``, by object.

    ``pictures``: each object's photograph (H, W, 3) in [0, 1] and mask (H, W) bool. Raises
    MachineError when there is no such environment or the model is not in it, NativeError when
    it ends without a whole result.
    """
    from ..core.images import to_uint8

    python = named_python(PYTHON_VARIABLE, _NAME, "--generate", _CURE)
    repository = Path(os.environ.get(REPOSITORY_VARIABLE, ""))
    if not (repository / "notebook" / "inference.py").is_file():
        raise MachineError(
            f"{REPOSITORY_VARIABLE} names no folder with notebook/inference.py", where=repository, cure=_CURE
        )
    if not (repository / PIPELINE).is_file():
        raise MachineError(f"the weights of {_NAME} are not there", where=repository / PIPELINE, cure=_CURE)
    inputs: dict[str, np.ndarray | Path] = {}
    for k, (image, mask) in enumerate(pictures.values()):
        inputs |= {f"photograph_{k:03d}": to_uint8(image), f"mask_{k:03d}": mask}
    request = Request("mesh", _NAME, {"seed": seed}, inputs)
    command = library_command(python, "workers.models.sam3d", str(repository.resolve()))
    meshes = {}
    with ProgramWorker(command, PYTHON_VARIABLE, _CURE) as worker, ask(worker, request, limits=_LIMITS) as response:
        for k, name in enumerate(pictures):
            if (made := f"mesh_{k:03d}") in response.files:
                meshes[name] = folder / f"mesh_{k}.glb"
                shutil.copyfile(response.file(made), meshes[name])
        return response.backend, meshes
