"""VGGT asked through ``VGGT``'s forward: see ``geometry.estimators.vggt``.

Its package, or the copy of it in map-anything, which takes DINOv2 from torch.hub, or from its cache once it is there.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from pathlib import Path
from typing import Any

from ..protocol.serving import Answer, Request, Tell
from .loading import Loaded, device_of, numbers, packages_of, run, weights_file

_LABEL = "VGGT"
REPOSITORY = "facebook/VGGT-1B"
_PLACES = ("vggt", "mapanything.models.external.vggt")


def _published(module: str) -> Any:
    """A module of VGGT, from where it is installed."""
    with packages_of(_LABEL):
        try:
            return importlib.import_module(f"{_PLACES[0]}.{module}")
        except ModuleNotFoundError:
            return importlib.import_module(f"{_PLACES[1]}.{module}")


def _load(name: str, random: bool) -> Any:
    network = _published("models.vggt").VGGT
    import torch

    made = _small(network) if random else network.from_pretrained(REPOSITORY)
    return made.to(device_of(torch)).eval()


def _small(network: Any) -> Any:
    """It with random weights, of as few blocks as it can be made with: its own package knows one size."""
    try:
        return network(depth=4, intermediate_layer_idx=[0, 1, 2, 3])
    except TypeError:
        return network()


def _weights(name: str) -> Path:
    return weights_file(REPOSITORY, "model.safetensors", _LABEL)


_LOADED = Loaded(_load, _weights)


def depth(request: Request, progress: Tell) -> Answer:
    """``depth``, ``confidence``, ``intrinsics`` and ``camera_from_world`` of the pictures together."""
    cameras_of = _published("utils.pose_enc").pose_encoding_to_extri_intri
    import torch

    pictures = request.array("pictures")
    progress(0, len(pictures), _LABEL)
    model, digest = _LOADED.model(request)
    device = device_of(torch)
    images = torch.from_numpy(pictures).to(device).permute(0, 3, 1, 2).float() / 255.0
    half = torch.bfloat16 if device == "cpu" or torch.cuda.get_device_capability()[0] >= 8 else torch.float16
    with torch.no_grad(), torch.autocast(device, dtype=half, enabled=device == "cuda"):
        said = model(images)
    camera_from_world, intrinsics = cameras_of(said["pose_enc"].float(), images.shape[-2:])
    progress(len(pictures), len(pictures), _LABEL)
    return Answer(
        _named(),
        digest,
        {
            "depth": said["depth"][0, ..., 0].float().cpu().numpy(),
            "confidence": said["depth_conf"][0].float().cpu().numpy(),
            "intrinsics": numbers(intrinsics[0].cpu()),
            "camera_from_world": numbers(camera_from_world[0].cpu()),
        },
    )


def _named() -> str:
    """With the version of the package that it is of."""
    for package in _PLACES:
        try:
            return f"{_LABEL} ({package.split('.')[0]} {importlib.metadata.version(package.split('.')[0])})"
        except importlib.metadata.PackageNotFoundError:
            continue
    return _LABEL


def main(*arguments: str) -> None:
    """The worker; a registrar asks for the same."""
    run({"depth": depth, "registration": depth}, _LOADED, arguments)
