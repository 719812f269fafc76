"""SAM 3D Objects in its own environment, as ``workers.sam3d`` asks it. Its one argument is the repository's folder."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from ..protocol.serving import Answer, Request, Tell, UnusableError, serve
from .loading import files_digest, require_gpu, version_of

PIPELINE = Path("checkpoints/hf/pipeline.yaml")
"""Where the repository says what its weights are, which lie beside."""

_NAME = "SAM 3D Objects"
_SERIES = ("0.0",)


def mesh(request: Request, progress: Tell) -> Answer:
    """The whole mesh of each object, in a frame of its own; the working folder is the repository."""
    version = version_of("sam3d_objects", _SERIES, _NAME, cure="")
    sys.path.insert(0, str(Path("notebook").resolve()))
    try:
        import numpy as np
        import torch
        from inference import Inference
    except ImportError as error:
        raise UnusableError(f"{_NAME} is not there: {error}") from error
    require_gpu(torch, _NAME)
    inference = Inference(str(PIPELINE.resolve()), compile=False)
    outputs = {}
    masks = sorted(name for name in request.files if name.startswith("mask_"))
    for done, name in enumerate(masks):
        number = name.partition("_")[2]
        photograph, mask = request.array(f"photograph_{number}"), request.array(name)
        output = inference(photograph, np.asarray(mask, bool), seed=request.parameters["seed"])
        if output.get("glb") is not None:
            outputs[f"mesh_{number}"] = request.folder / f"mesh_{number}.glb"
            output["glb"].export(str(outputs[f"mesh_{number}"]))
        progress(done + 1, len(masks), "Meshes")
    weights = files_digest(sorted(file for file in PIPELINE.resolve().parent.iterdir() if file.is_file()))
    return Answer(f"{_NAME} {version}", weights, outputs)


def main(repository: str) -> None:
    """Serve meshes."""
    # The repository's script reads the toolkit's place from a conda environment.
    os.environ.setdefault("CONDA_PREFIX", sys.prefix)
    os.chdir(repository)
    serve({"mesh": mesh})
