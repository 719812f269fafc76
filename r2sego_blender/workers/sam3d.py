"""SAM 3D Objects (Meta, 2025), the paper's source of shape priors, in its own environment.

One photograph and the mask of an object in it in, the object's whole mesh out, in a frame of
its own; where it stands is found by alignment like any other mesh's. Only the published
interface is used: ``Inference`` of the repository's ``notebook/inference.py``, called with
image, mask and seed. It needs Linux, an NVIDIA GPU of 32 GB, and weights that are given on
request, under a licence of their own; it runs in the interpreter that the environment
variable ``R2SEGO_SAM3D_PYTHON`` names, on the repository in ``R2SEGO_SAM3D_REPOSITORY``.

Request: ``protocol``, ``repository``, ``seed``, ``folder``, and ``objects``, a list of ``name``,
``photograph`` and ``mask`` (files). Result: ``protocol``, ``backend`` with its version, and
``meshes`` (name -> file in that folder); an object without a mesh is left out.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import MachineError, NativeError
from .child import call_in_child
from .external_environment import PROTOCOL, accepted_version, checked_request, checked_result, named_python, require_gpu

if TYPE_CHECKING:
    import numpy as np

PYTHON_VARIABLE = "R2SEGO_SAM3D_PYTHON"
REPOSITORY_VARIABLE = "R2SEGO_SAM3D_REPOSITORY"
_NAME = "SAM 3D Objects"
_SERIES = ("0.0",)
_PIPELINE = Path("checkpoints/hf/pipeline.yaml")
_TIMEOUT_S = 4 * 3600.0
_CURE = (
    f"Set up github.com/facebookresearch/sam-3d-objects with its weights in {_PIPELINE.parent}, set "
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
    from ..core.images import save_image

    python = named_python(PYTHON_VARIABLE, _NAME, "--generate", _CURE)
    repository = Path(os.environ.get(REPOSITORY_VARIABLE, ""))
    if not (repository / "notebook" / "inference.py").is_file():
        raise MachineError(
            f"{REPOSITORY_VARIABLE} names no folder with notebook/inference.py", where=repository, cure=_CURE
        )
    objects = []
    for k, (name, (image, mask)) in enumerate(pictures.items()):
        photograph, outline = folder / f"photograph_{k}.png", folder / f"mask_{k}.png"
        save_image(photograph, image)
        save_image(outline, mask.astype("uint8") * 255)
        objects.append({"name": name, "photograph": str(photograph), "mask": str(outline)})
    request = {
        "protocol": PROTOCOL,
        "repository": str(repository.resolve()),
        "seed": seed,
        "folder": str(folder),
        "objects": objects,
    }
    result = call_in_child(_generate, request, python=python, timeout_s=_TIMEOUT_S)
    checked_result(result, _NAME, ["meshes"])
    meshes = {name: Path(file) for name, file in result["meshes"].items() if name in pictures}
    for name, file in meshes.items():
        if not file.is_file():
            raise NativeError(f"the mesh that {_NAME} declared is not there", where=name, cure="Try again.")
    return result["backend"], meshes


def _generate(request: dict[str, Any]) -> dict[str, Any]:
    """Runs in the other environment."""
    checked_request(request)
    version = accepted_version("sam3d_objects", _SERIES, _NAME, PYTHON_VARIABLE, _CURE)
    repository = Path(request["repository"])
    if not (repository / _PIPELINE).is_file():
        raise MachineError(f"the weights of {_NAME} are not there", where=repository / _PIPELINE, cure=_CURE)
    # The repository's script reads the toolkit's place from a conda environment.
    os.environ.setdefault("CONDA_PREFIX", sys.prefix)
    os.chdir(repository)
    sys.path.insert(0, str(repository / "notebook"))
    try:
        import numpy as np
        import torch
        from inference import Inference
        from PIL import Image
    except ImportError as error:
        raise MachineError(f"{_NAME} is not there: {error}", where=PYTHON_VARIABLE, cure=_CURE) from error
    require_gpu(torch, _NAME, PYTHON_VARIABLE, _CURE)
    inference = Inference(str(repository / _PIPELINE), compile=False)
    meshes = {}
    for k, one in enumerate(request["objects"]):
        with Image.open(one["photograph"]) as image, Image.open(one["mask"]) as mask:
            output = inference(
                np.asarray(image.convert("RGB")), np.asarray(mask.convert("L")) > 0, seed=request["seed"]
            )
        if output.get("glb") is not None:
            path = Path(request["folder"], f"mesh_{k}.glb")
            output["glb"].export(str(path))
            meshes[one["name"]] = str(path)
    return {"protocol": PROTOCOL, "backend": f"{_NAME} {version}", "meshes": meshes}
