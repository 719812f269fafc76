"""NKSR (Huang et al., CVPR 2023), the paper's surface reconstructor, in its own environment.

NKSR needs Linux, an NVIDIA GPU and an older torch than this project's, so it runs in the
interpreter that the environment variable ``R2SEGO_NKSR_PYTHON`` names, Python 3.10 or 3.11.
Only its published interface is used: a ``Reconstructor``, points with normals in, the dual
mesh out. Its code and weights are under a licence of their own, which forbids much.
"""

from __future__ import annotations

from pathlib import Path

from ..core.errors import MachineError
from .child import call_in_child
from .external_environment import named_python, require_gpu

PYTHON_VARIABLE = "R2SEGO_NKSR_PYTHON"
_CURE = (
    f"Install nksr (github.com/nv-tlabs/NKSR) with its torch in an environment of its own and set "
    f"{PYTHON_VARIABLE} to that environment's python, or take another backend: --set proxy.surface=tsdf."
)


def reconstruct_externally(cloud: Path, surface: Path, voxel_m: float) -> None:
    """Write ``surface`` (.npz: vertices, faces) for the ``cloud`` (.npz: points, normals), metres.

    Raises MachineError when there is no such environment or NKSR is not in it, NativeError
    when it ends without a result.
    """
    python = named_python(PYTHON_VARIABLE, "NKSR", "proxy.surface", _CURE)
    request = {"cloud": str(cloud), "surface": str(surface), "voxel_m": voxel_m}
    call_in_child(_reconstruct, request, python=python)


def _reconstruct(request: dict) -> dict:
    """Runs in the other environment."""
    try:
        import nksr
        import numpy as np
        import torch
    except ImportError as error:
        raise MachineError(f"NKSR is not there: {error}", where=PYTHON_VARIABLE, cure=_CURE) from error
    require_gpu(torch, "NKSR", PYTHON_VARIABLE, _CURE)
    device = torch.device("cuda:0")
    with np.load(request["cloud"]) as data:
        points, normals = (torch.from_numpy(data[name]).float().to(device) for name in ("points", "normals"))
    field = nksr.Reconstructor(device).reconstruct(points, normals, voxel_size=request["voxel_m"])
    mesh = field.extract_dual_mesh(mise_iter=1)
    np.savez(request["surface"], vertices=mesh.v.cpu().numpy(), faces=mesh.f.cpu().numpy())
    return {}
