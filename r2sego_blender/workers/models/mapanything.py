"""MapAnything asked through ``MapAnything.infer``: see ``geometry.estimators.mapanything``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..protocol.serving import Answer, Request, Tell, UnusableError
from .loading import Loaded, device_of, numbers, packages_of, run, version_of, weights_file

_LABEL = "MapAnything"
_SERIES = ("1.1",)
_REPOSITORY = "facebook/map-anything-apache"


def _load(name: str, random: bool) -> Any:
    with packages_of(_LABEL):
        import torch
        from mapanything.models import MapAnything
    if random:  # its encoder is DINOv2, whose code it takes from the network
        raise UnusableError("MapAnything is not made of random weights: its configuration comes with its weights")
    return MapAnything.from_pretrained(_REPOSITORY).to(device_of(torch)).eval()


def _weights(name: str) -> Path:
    return weights_file(_REPOSITORY, "model.safetensors", _LABEL)


_LOADED = Loaded(_load, _weights)


def depth(request: Request, progress: Tell) -> Answer:
    """``depth_z``, ``confidence``, ``intrinsics`` and ``camera_poses`` of the pictures, by what is told of them."""
    version = version_of("mapanything", _SERIES, _LABEL)
    with packages_of(_LABEL):
        import torch
        from mapanything.utils.image import preprocess_inputs
    pictures = request.array("pictures")
    progress(0, len(pictures), _LABEL)
    model, digest = _LOADED.model(request)
    views: list[dict[str, Any]] = [{"img": one} for one in pictures]
    if "camera_poses" in request.files:
        told = [request.array(name).astype(np.float32) for name in ("intrinsics", "camera_poses")]
        for k, view in enumerate(views):
            view.update(intrinsics=told[0][k], camera_poses=told[1][k], is_metric_scale=torch.tensor([True]))
    said = model.infer(
        preprocess_inputs(views),
        memory_efficient_inference=True,
        use_amp=device_of(torch) == "cuda",
        apply_mask=True,
        mask_edges=True,
    )
    progress(len(pictures), len(pictures), _LABEL)
    return Answer(
        f"{_LABEL} {version}",
        digest,
        {
            "depth_z": np.stack([_one(one["depth_z"])[..., 0] for one in said]),
            "confidence": np.stack([_one(one["conf"]) for one in said]),
            "intrinsics": numbers([_one(one["intrinsics"]) for one in said]),
            "camera_poses": numbers([_one(one["camera_poses"]) for one in said]),
        },
    )


def _one(batch_of_one: Any) -> np.ndarray:
    found: np.ndarray = batch_of_one[0].float().cpu().numpy()
    return found


def main(*arguments: str) -> None:
    """The worker."""
    run({"depth": depth}, _LOADED, arguments)
