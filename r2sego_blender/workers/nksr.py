"""NKSR (Huang et al., CVPR 2023), the paper's surface reconstructor, in its own environment.

NKSR needs Linux, an NVIDIA GPU and an older torch than this project's, so it runs in the
interpreter that the environment variable ``R2SEGO_NKSR_PYTHON`` names, Python 3.10 or 3.11.
Only its published interface is used: a ``Reconstructor``, points with normals in, the dual
mesh out. Its code and weights are under a licence of their own, which forbids much. What runs there is
``workers.models.nksr``, asked for the task "surface": inputs ``points`` and ``normals``, (P, 3); the parameter
``voxel_m``; outputs ``vertices`` (V, 3) and ``faces`` (F, 3).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .external_environment import named_python
from .learned_backends import LEARNED_BACKENDS
from .protocol.asking import ask
from .protocol.program_worker import ProgramWorker, library_command
from .protocol.request import Request
from .protocol.response import Limits

if TYPE_CHECKING:
    import numpy as np

PYTHON_VARIABLE = LEARNED_BACKENDS["nksr"].variable
_NAME = "NKSR"
_LIMITS = Limits(seconds=1800.0, silent_s=1800.0)
_CURE = (
    f"Install nksr (github.com/nv-tlabs/NKSR) with its torch in an environment of its own and set "
    f"{PYTHON_VARIABLE} to that environment's python, or take another backend: --set proxy.surface=tsdf."
)


def reconstruct_externally(points: np.ndarray, normals: np.ndarray, voxel_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3), metres, and faces (F, 3) of the surface of oriented points (P, 3).

    Raises MachineError when there is no such environment or NKSR is not in it, NativeError
    when it ends without a right result.
    """
    from ..core.arrays import require_indices

    python = named_python(PYTHON_VARIABLE, _NAME, "proxy.surface", _CURE)
    request = Request("surface", _NAME, {"voxel_m": voxel_m}, {"points": points, "normals": normals})
    command = library_command(python, "workers.models.nksr")
    with ProgramWorker(command, PYTHON_VARIABLE, _CURE) as worker, ask(worker, request, limits=_LIMITS) as response:
        vertices, faces = response.array("vertices", (None, 3)), response.array("faces", (None, 3), "iu")
        try:
            require_indices(len(vertices), faces=faces)
        except ValueError as error:
            raise response.wrong(f"gave a surface of which the {error}") from error
        return vertices, faces
