"""SAM 3 (Meta, 2025), the paper's source of object masks, in its own environment.

A vocabulary of words in, the mask of every thing that one of them names out, photograph by
photograph. Only the published interface is used: ``build_sam3_image_model``, and a
``Sam3Processor`` with ``set_image`` and ``set_text_prompt``. SAM 3 needs Python 3.12, torch 2.7
and an NVIDIA GPU, and its weights are given on request, under a licence of their own; it runs
in the interpreter that the environment variable ``R2SEGO_SAM3_PYTHON`` names.

Request: ``protocol``, ``photographs`` (name -> file), ``vocabulary``, ``least_score``, ``folder``.
Result: ``protocol``, ``backend`` with its version, and ``masks``, a list of ``photograph``,
``word``, ``score`` and ``file``, a black and white image in that folder.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import MachineError, NativeError
from ..core.scratch import ScratchFolder
from .child import call_in_child
from .external_environment import PROTOCOL, accepted_version, checked_request, checked_result, named_python, require_gpu

if TYPE_CHECKING:
    import numpy as np

PYTHON_VARIABLE = "R2SEGO_SAM3_PYTHON"
_NAME = "SAM 3"
_SERIES = ("0.1",)
_WHITE = 128
_CURE = (
    f"Install sam3 (github.com/facebookresearch/sam3) in an environment of its own, ask for its weights, and "
    f"set {PYTHON_VARIABLE} to that environment's python, or draw the masks: --masks FOLDER."
)


@dataclass(frozen=True)
class FoundMask:
    """One thing in one photograph: ``mask`` (H, W) bool, named by a ``word`` of the vocabulary."""

    photograph: str
    word: str
    score: float
    mask: np.ndarray


def segment_externally(
    photographs: Mapping[str, np.ndarray], vocabulary: Sequence[str], least_score: float = 0.5
) -> tuple[str, tuple[FoundMask, ...]]:
    """The backend with its version, and what it found in ``photographs``, (H, W, 3) in [0, 1].

    Raises MachineError when there is no such environment or SAM 3 is not in it, NativeError
    when it ends without a whole result.
    """
    from ..core.images import load_image_uint8, save_image

    python = named_python(PYTHON_VARIABLE, _NAME, "--segment", _CURE)
    with ScratchFolder() as folder:
        files = {name: Path(folder, f"photograph_{k}.png") for k, name in enumerate(photographs)}
        for name, image in photographs.items():
            save_image(files[name], image)
        request = {
            "protocol": PROTOCOL,
            "photographs": {name: str(file) for name, file in files.items()},
            "vocabulary": list(vocabulary),
            "least_score": least_score,
            "folder": folder,
        }
        result = call_in_child(_segment, request, python=python)
        checked_result(result, _NAME, ["masks"])
        found = []
        for one in result["masks"]:
            mask = load_image_uint8(Path(one["file"]))[..., 0] >= _WHITE
            if mask.shape != photographs[one["photograph"]].shape[:2]:
                raise NativeError(
                    f"a mask of {_NAME} has not the size of its photograph",
                    where=one["photograph"],
                    cure="Update the adapter's environment.",
                )
            found.append(FoundMask(one["photograph"], one["word"], float(one["score"]), mask))
        return result["backend"], tuple(found)


def _segment(request: dict[str, Any]) -> dict[str, Any]:
    """Runs in the other environment."""
    checked_request(request)
    version = accepted_version("sam3", _SERIES, _NAME, PYTHON_VARIABLE, _CURE)
    try:
        import numpy as np
        import torch
        from PIL import Image
        from sam3.model.sam3_image_processor import Sam3Processor
        from sam3.model_builder import build_sam3_image_model
    except ImportError as error:
        raise MachineError(f"{_NAME} is not there: {error}", where=PYTHON_VARIABLE, cure=_CURE) from error
    require_gpu(torch, _NAME, PYTHON_VARIABLE, _CURE)
    masks: list[dict[str, Any]] = []
    with torch.inference_mode(), torch.autocast("cuda", dtype=torch.bfloat16):
        processor = Sam3Processor(build_sam3_image_model(), confidence_threshold=request["least_score"])
        for name, file in request["photographs"].items():
            with Image.open(file) as image:
                state = processor.set_image(image.convert("RGB"))
                size = image.size[::-1]
            for word in request["vocabulary"]:
                output = processor.set_text_prompt(state=state, prompt=word)
                found = output["masks"].float().cpu().numpy().reshape(-1, *size) > 0.5
                scores = output["scores"].float().cpu().numpy().ravel()
                for mask, score in zip(found, scores, strict=True):
                    path = Path(request["folder"], f"mask_{len(masks)}.png")
                    Image.fromarray(mask.astype(np.uint8) * 255).save(path)
                    masks.append({"photograph": name, "word": word, "score": float(score), "file": str(path)})
    return {"protocol": PROTOCOL, "backend": f"{_NAME} {version}", "masks": masks}
