"""ViewCrafter in its own environment, a worker that makes clips. Its arguments are the repository and the checkpoint.

Only what the repository publishes is used: ``utils.diffusion_utils`` with its functions
``instantiate_from_config``, ``load_model_checkpoint`` and ``image_guided_synthesis``, and its
configurations. DUSt3R and PyTorch3D, which it makes its own point clouds with, are not needed:
the clouds are the conditions'. The model stays loaded. This file runs under Python 3.9.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

from ..protocol.serving import Answer, Request, Tell, UnusableError, file_digest, serve

FRAMES = 25

_CONFIGURATIONS = {(1024, 576): "inference_pvd_1024.yaml", (512, 320): "inference_pvd_512.yaml"}
_PROMPT = "Rotating view of a scene"  # the one it was trained with
_SAMPLING = {
    "n_samples": 1,
    "ddim_steps": 50,
    "ddim_eta": 1.0,
    "unconditional_guidance_scale": 7.5,
    "cfg_img": None,
    "fs": 10,
    "text_input": True,
    "multiple_cond_cfg": False,
    "timestep_spacing": "uniform_trailing",
    "guidance_rescale": 0.7,
    "condition_index": [0],
}
_LATENT_STRIDE = 8  # pixels a side that one latent stands for


class ViewCrafter:
    """The diffusion model of one size, loaded."""

    def __init__(self, repository: Path, checkpoint: Path, size: tuple[int, int]) -> None:
        """``size``: (width, height) in pixels. Raises UnusableError when something is missing."""
        if size not in _CONFIGURATIONS:
            raise UnusableError(f"ViewCrafter makes no frames of {size[0]}x{size[1]} pixels")
        try:
            import torch
            from omegaconf import OmegaConf
            from pytorch_lightning import seed_everything
            from utils import diffusion_utils
        except ImportError as error:
            raise UnusableError(f"ViewCrafter's environment is not complete: {error}") from error
        if not torch.cuda.is_available():
            raise UnusableError("ViewCrafter needs an NVIDIA GPU")
        self._torch, self._seed = torch, seed_everything
        self._synthesis = diffusion_utils.image_guided_synthesis
        configuration = OmegaConf.load(str(repository / "configs" / _CONFIGURATIONS[size]))["model"]
        # Checkpointing of gradients is for training, and needs deepspeed.
        configuration["params"]["unet_config"]["params"]["use_checkpoint"] = False
        model = diffusion_utils.instantiate_from_config(configuration).to("cuda:0")
        model.cond_stage_model.device = "cuda:0"
        model.perframe_ae = True  # decodes one frame after the other: 24 GB are enough
        self._model = diffusion_utils.load_model_checkpoint(model, str(checkpoint))
        self._model.eval()
        self.size = size

    def clip(self, frames: Any, seed: int) -> Any:
        """(25, H, W, 3) float32 in [0, 1] with black gaps in, the same without gaps out."""
        import numpy as np

        height, width = frames.shape[1:3]
        channels = self._model.model.diffusion_model.out_channels
        noise = [1, channels, FRAMES, height // _LATENT_STRIDE, width // _LATENT_STRIDE]
        shown = np.ascontiguousarray((frames * 2.0 - 1.0).transpose(3, 0, 1, 2)[None], np.float32)
        video = self._torch.from_numpy(shown).to("cuda:0")
        self._seed(seed)
        with self._torch.no_grad(), self._torch.cuda.amp.autocast():
            made = self._synthesis(self._model, [_PROMPT], video, noise, **_SAMPLING)
        made = made[0, 0].float().cpu().numpy().transpose(1, 2, 3, 0)  # of batch, variant, c, t, h, w
        return np.clip(0.5 + 0.5 * made, 0.0, 1.0)


class Clips:
    """The task "clip", with the model of the last clip's size."""

    def __init__(self, repository: Path, checkpoint: Path) -> None:
        self._repository, self._checkpoint = repository, checkpoint
        self._model: ViewCrafter | None = None
        self._weights = ""

    def clip(self, request: Request, progress: Tell) -> Answer:
        """The frames of a clip of its point conditions."""
        import numpy as np
        from PIL import Image

        asked = request.parameters
        if asked["frames"] != FRAMES:
            raise UnusableError(f"ViewCrafter makes clips of {FRAMES} frames, not of {asked['frames']}")
        size = (asked["width"], asked["height"])
        if self._model is None or self._model.size != size:
            self._model = ViewCrafter(self._repository, self._checkpoint, size)
            self._weights = self._weights or file_digest(self._checkpoint)
        shown = []
        for index in range(FRAMES):
            with Image.open(request.files[f"conditions/{index:03d}_points.png"]) as image:
                shown.append(np.asarray(image.convert("RGB"), np.float32) / 255.0)
        made = self._model.clip(np.stack(shown), asked["seed"])
        (request.folder / "frames").mkdir()
        outputs = {}
        for index, frame in enumerate(made):
            name = f"frames/{index:03d}.png"
            outputs[name] = request.folder / name
            Image.fromarray((frame * 255.0 + 0.5).astype(np.uint8)).save(outputs[name], compress_level=3)
        backend = f"ViewCrafter {self._checkpoint.name} {size[0]}x{size[1]}"
        return Answer(backend, self._weights, outputs, {"frames": len(made)})


def main(repository: str, checkpoint: str) -> None:
    """Serve clips, in the repository's folder."""
    sys.path.insert(0, repository)
    os.chdir(repository)
    serve({"clip": Clips(Path(repository), Path(checkpoint)).clip})
