"""Difix3D+ in its own environment: the published one-step model with a reference, nvidia/difix_ref.

Asked through ``DifixPipeline`` of the repository's ``src`` as its README has it; pictures have the size that
``src/inference_difix.py``, its step after rendering, gives them, and come back in their own: see
``evaluation.external_arms.difix3d_plus``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..protocol.serving import Answer, RefusedError, Request, Tell
from .loading import packages_of, require_gpu, run, state_digest, weights_file

REPOSITORY = "nvidia/difix_ref"
SIZE = (1024, 576)
"""Width and height of what the model sees, whatever the picture's: it was trained so."""

_LABEL = "Difix3D+"
_ASKED = {"num_inference_steps": 1, "timesteps": [199], "guidance_scale": 0.0}
_PROMPT = "remove degradation"


class _Loaded:
    """The pipeline, loaded once."""

    def __init__(self) -> None:
        self._kept: tuple[Any, str] | None = None

    def model(self) -> tuple[Any, str]:
        """The pipeline on the GPU, and the digest of all its networks' weights."""
        if self._kept is None:
            with packages_of(_LABEL):
                import torch
                from pipeline_difix import DifixPipeline
            require_gpu(torch, _LABEL)
            self.check("")
            pipeline = DifixPipeline.from_pretrained(REPOSITORY, trust_remote_code=True)
            pipeline.set_progress_bar_config(disable=True)
            pipeline.to("cuda")
            networks = torch.nn.ModuleList([pipeline.unet, pipeline.vae, pipeline.text_encoder])
            self._kept = pipeline, state_digest(torch, networks)
        return self._kept

    def fetch(self, name: str) -> None:
        """Have the model fetch its weights."""
        with packages_of(_LABEL):
            from pipeline_difix import DifixPipeline
        DifixPipeline.from_pretrained(REPOSITORY, trust_remote_code=True)

    def check(self, name: str) -> None:
        """Raises UnusableError where the weights are not there."""
        with packages_of(_LABEL):
            weights_file(REPOSITORY, "model_index.json", _LABEL)


_LOADED = _Loaded()


def views(request: Request, progress: Tell) -> Answer:
    """``view_000`` and on: each rendering, fixed with its reference."""
    from PIL import Image

    if request.parameters.get("random_weights"):
        raise RefusedError("it knows no model of random weights")
    numbers = [name.rpartition("_")[2] for name in sorted(request.files) if name.startswith("rendering_")]
    progress(0, len(numbers), _LABEL)
    pipeline, digest = _LOADED.model()
    outputs = {}
    for done, number in enumerate(numbers, 1):
        rendering, reference = (
            Image.fromarray(request.array(f"{kind}_{number}")) for kind in ("rendering", "reference")
        )
        shown, with_it = (one.resize(SIZE, Image.Resampling.LANCZOS) for one in (rendering, reference))
        made = pipeline(_PROMPT, image=shown, ref_image=with_it, **_ASKED).images[0]
        outputs[f"view_{number}"] = np.asarray(
            made.resize(rendering.size, Image.Resampling.LANCZOS).convert("RGB"), np.uint8
        )
        progress(done, len(numbers), _LABEL)
    return Answer(f"{_LABEL} ({REPOSITORY})", digest, outputs)


def main(*arguments: str) -> None:
    """Serve views."""
    run({"views": views}, _LOADED, arguments)
