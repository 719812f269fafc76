"""Depth Anything 3 asked through ``DepthAnything3.inference``: see ``geometry.estimators.depth_anything_3``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..protocol.serving import Answer, Request, Tell
from .loading import Loaded, device_of, numbers, packages_of, run, version_of, weights_file

_LABEL = "Depth Anything 3"
_SERIES = ("0.0", "0.1")
_SIZES = {"depth-anything-3-base": "base", "depth-anything-3-small": "small"}


def _load(name: str, random: bool) -> Any:
    with packages_of(_LABEL):
        import torch
        from depth_anything_3.api import DepthAnything3
    size = _SIZES[name]
    made = DepthAnything3(f"da3-{size}") if random else DepthAnything3.from_pretrained(_repository(name))
    return made.to(device_of(torch)).eval()


def _repository(name: str) -> str:
    return f"depth-anything/DA3-{_SIZES[name].upper()}"


def _weights(name: str) -> Path:
    return weights_file(_repository(name), "model.safetensors", _LABEL)


_LOADED = Loaded(_load, _weights)


def depth(request: Request, progress: Tell) -> Answer:
    """``depth``, ``confidence``, ``intrinsics`` and ``camera_from_world`` of the pictures, by given ones or its own."""
    version = version_of("depth-anything-3", _SERIES, _LABEL)
    pictures = request.array("pictures")
    progress(0, len(pictures), _LABEL)
    model, digest = _LOADED.model(request)
    posed = "camera_from_world" in request.files
    said = model.inference(
        list(pictures),
        extrinsics=request.array("camera_from_world").astype(np.float32) if posed else None,
        intrinsics=request.array("intrinsics").astype(np.float32) if posed else None,
        process_res=504,
        process_res_method="upper_bound_resize",
    )
    progress(len(pictures), len(pictures), _LABEL)
    return Answer(
        f"{_LABEL} {_SIZES[request.backend].upper()} {version}",
        digest,
        {
            "depth": np.asarray(said.depth, np.float32),
            "confidence": np.asarray(said.conf, np.float32),
            "intrinsics": numbers(said.intrinsics),
            "camera_from_world": numbers(said.extrinsics)[:, :3],
        },
    )


def main(*arguments: str) -> None:
    """The worker."""
    run({"depth": depth}, _LOADED, arguments)
