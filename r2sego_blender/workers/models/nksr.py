"""NKSR in its own environment, as ``workers.nksr`` asks it."""

from __future__ import annotations

from ..protocol.serving import Answer, Request, Tell, UnusableError, serve
from .loading import require_gpu, state_digest

_NAME = "NKSR"


def surface(request: Request, progress: Tell) -> Answer:
    """The dual mesh of points with normals, metres."""
    try:
        import nksr
        import torch
    except ImportError as error:
        raise UnusableError(f"{_NAME} is not there: {error}") from error
    require_gpu(torch, _NAME)
    device = torch.device("cuda:0")
    points, normals = (torch.from_numpy(request.array(name)).float().to(device) for name in ("points", "normals"))
    reconstructor = nksr.Reconstructor(device)
    field = reconstructor.reconstruct(points, normals, voxel_size=request.parameters["voxel_m"])
    mesh = field.extract_dual_mesh(mise_iter=1)
    outputs = {"vertices": mesh.v.cpu().numpy(), "faces": mesh.f.cpu().numpy()}
    version = getattr(nksr, "__version__", "")
    return Answer(f"{_NAME} {version}".strip(), state_digest(torch, reconstructor.network), outputs)


def main() -> None:
    """Serve surfaces."""
    serve({"surface": surface})
