"""SAM 3 in its own environment, as ``workers.sam3`` asks it."""

from __future__ import annotations

from typing import Any

from ..protocol.serving import Answer, Request, Tell, UnusableError, serve
from .loading import require_gpu, state_digest, version_of

_NAME = "SAM 3"
_SERIES = ("0.1",)


def masks(request: Request, progress: Tell) -> Answer:
    """The mask of every thing that a word of the vocabulary names, photograph by photograph."""
    version = version_of("sam3", _SERIES, _NAME, cure="")
    try:
        import numpy as np
        import torch
        from PIL import Image
        from sam3.model.sam3_image_processor import Sam3Processor
        from sam3.model_builder import build_sam3_image_model
    except ImportError as error:
        raise UnusableError(f"{_NAME} is not there: {error}") from error
    require_gpu(torch, _NAME)
    told: list[dict[str, Any]] = []
    outputs = {}
    with torch.inference_mode(), torch.autocast("cuda", dtype=torch.bfloat16):
        model = build_sam3_image_model()
        processor = Sam3Processor(model, confidence_threshold=request.parameters["least_score"])
        for number, name in enumerate(sorted(request.files)):
            image = Image.fromarray(request.array(name))
            state = processor.set_image(image)
            for word in request.parameters["vocabulary"]:
                output = processor.set_text_prompt(state=state, prompt=word)
                found = output["masks"].float().cpu().numpy().reshape(-1, *image.size[::-1]) > 0.5
                scores = output["scores"].float().cpu().numpy().ravel()
                for mask, score in zip(found, scores, strict=True):
                    mask_name = f"mask_{len(told):05d}"
                    outputs[mask_name] = request.folder / f"{mask_name}.png"
                    Image.fromarray(mask.astype(np.uint8) * 255).save(outputs[mask_name])
                    told.append({"output": mask_name, "photograph": number, "word": word, "score": float(score)})
            progress(number + 1, len(request.files), "Masks")
    return Answer(f"{_NAME} {version}", state_digest(torch, model), outputs, {"masks": told})


def main() -> None:
    """Serve masks."""
    serve({"masks": masks})
