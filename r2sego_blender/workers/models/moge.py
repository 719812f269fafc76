"""MoGe-2 asked through ``MoGeModel.infer``, a picture at a time: see ``geometry.estimators.moge``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..protocol.serving import Answer, Request, Tell
from .loading import Loaded, device_of, packages_of, run, version_of, weights_file

_LABEL = "MoGe-2"
_SERIES = ("2.0",)
_REPOSITORY = "Ruicheng/moge-2-vitb-normal"
_STACK = {"dim_res_blocks": (32, 32, 32, 32, 32), "num_res_blocks": 0, "resamplers": ("bilinear",) * 4}
_HEAD = {**_STACK, "dim_in": (32, 32, 32, 32, 32)}
_TINY = {
    "encoder": {"backbone": "dinov2_vits14", "intermediate_layers": [5, 11], "dim_out": 32},
    "neck": {**_STACK, "dim_in": (34, 2, 2, 2, 2), "dim_out": None},
    "points_head": {**_HEAD, "dim_out": (None, None, None, None, 3)},
    "mask_head": {**_HEAD, "dim_out": (None, None, None, None, 1)},
    "scale_head": {"dims": [384, 32, 1]},
    "remap_output": "exp",
    "num_tokens_range": [100, 200],
}  # for random weights


def _load(name: str, random: bool) -> Any:
    with packages_of(_LABEL):
        import torch
        from moge.model.v2 import MoGeModel
    made = MoGeModel(**_TINY) if random else MoGeModel.from_pretrained(_REPOSITORY)
    return made.to(device_of(torch)).eval()


def _weights(name: str) -> Path:
    return weights_file(_REPOSITORY, "model.pt", _LABEL)


_LOADED = Loaded(_load, _weights)


def depth(request: Request, progress: Tell) -> Answer:
    """``depth`` of each picture, by its field of view; 0 where the model's mask leaves it out."""
    version = version_of("moge", _SERIES, _LABEL)
    import torch

    pictures, fields_of_view = request.array("pictures"), request.array("fov_x")
    progress(0, len(pictures), _LABEL)
    model, digest = _LOADED.model(request)
    device = device_of(torch)
    found: list[np.ndarray] = []
    for picture in pictures:
        image = torch.from_numpy(picture).to(device).permute(2, 0, 1).float() / 255.0
        said = model.infer(image, fov_x=float(fields_of_view[len(found)]), use_fp16=device == "cuda")
        values = said["depth"].float().cpu().numpy()
        found.append(np.where(np.isfinite(values), values, 0.0).astype(np.float32))  # infinite where masked
        progress(len(found), len(pictures), _LABEL)
    return Answer(f"{_LABEL} {version}", digest, {"depth": np.stack(found)})


def main(*arguments: str) -> None:
    """The worker."""
    run({"depth": depth}, _LOADED, arguments)
