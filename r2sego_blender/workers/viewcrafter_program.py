"""ViewCrafter as a generator program (docs/backends.md), run by its path in ViewCrafter's Python.

    python viewcrafter_program.py REPOSITORY CHECKPOINT FOLDER

Only what the repository publishes is used: ``utils.diffusion_utils`` with its functions
``instantiate_from_config``, ``load_model_checkpoint`` and ``image_guided_synthesis``, and its
configurations. DUSt3R and PyTorch3D, which it makes its own point clouds with, are not needed:
the clouds are the conditions'. The model stays loaded and waits for further folders on its
standard input. This file runs under Python 3.9 and imports nothing of this package.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

PROTOCOL = 1
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


class UnusableError(Exception):
    """What is wrong with this environment, in words for the person."""


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


def answer(folder: Path, repository: Path, checkpoint: Path, model: ViewCrafter | None) -> ViewCrafter:
    """Generate the clip that ``folder`` asks for, with ``model`` if it is loaded; returns it."""
    import numpy as np
    from PIL import Image

    request = json.loads((folder / "request.json").read_text(encoding="utf-8"))
    if request["protocol"] != PROTOCOL:
        raise UnusableError(f"the request follows protocol {request['protocol']}, this program {PROTOCOL}")
    if request["frames"] != FRAMES:
        raise UnusableError(f"ViewCrafter makes clips of {FRAMES} frames, not of {request['frames']}")
    size = (request["width"], request["height"])
    if model is None or model.size != size:
        model = ViewCrafter(repository, checkpoint, size)
    frames = []
    for index in range(FRAMES):
        with Image.open(folder / "conditions" / f"{index:03d}_points.png") as image:
            frames.append(np.asarray(image.convert("RGB"), np.float32) / 255.0)
    made = model.clip(np.stack(frames), request["seed"])
    (folder / "frames").mkdir()
    for index, frame in enumerate(made):
        pixels = (frame * 255.0 + 0.5).astype(np.uint8)
        Image.fromarray(pixels).save(folder / "frames" / f"{index:03d}.png", compress_level=3)
    name = f"ViewCrafter {checkpoint.name} {size[0]}x{size[1]}"
    tell(folder, {"protocol": PROTOCOL, "backend": name, "frames": len(made), "waits": True})
    return model


def tell(folder: Path, result: dict[str, Any]) -> None:
    """Write ``result.json``, whole or not at all."""
    unfinished = folder / "result.json.tmp"
    unfinished.write_text(json.dumps(result), encoding="utf-8")
    unfinished.replace(folder / "result.json")


def main(repository: Path, checkpoint: Path, folder: Path) -> None:
    """Answer ``folder`` and every folder that standard input names, until that ends."""
    sys.path[0] = str(repository)  # in place of this file's folder, whose modules have other uses
    os.chdir(repository)
    model = None
    while True:
        try:
            model = answer(folder, repository, checkpoint, model)
        except UnusableError as error:
            tell(folder, {"protocol": PROTOCOL, "error": str(error)})
            sys.exit(1)
        line = sys.stdin.readline()
        if not line:
            return
        folder = Path(line.rstrip("\n"))


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:4]))
