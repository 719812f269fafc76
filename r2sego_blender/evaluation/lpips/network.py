"""The network of LPIPS-Alex, with the weights that a person gives; see ``weights``."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import torch
from torch import nn

_CONVOLUTIONS = {
    0: (3, 64, 11, 4, 2),
    3: (64, 192, 5, 1, 2),
    6: (192, 384, 3, 1, 1),
    8: (384, 256, 3, 1, 1),
    10: (256, 256, 3, 1, 1),
}
"""AlexNet's layers by torchvision's index: channels in and out, kernel, stride, padding."""

_POOLED_BEFORE = frozenset({3, 6})
_MOST_BYTES = 1 << 30
"""AlexNet's have 244 MB."""

_MEAN = (-0.030, -0.088, -0.188)
_DEVIATION = (0.458, 0.448, 0.450)


class Lpips(nn.Module):
    """The perceptual distance of two images: weighted differences of AlexNet's features."""

    def __init__(self) -> None:
        super().__init__()
        self.convolutions = nn.ModuleDict(
            {
                str(index): nn.Conv2d(channels, out, kernel, stride, padding)
                for index, (channels, out, kernel, stride, padding) in _CONVOLUTIONS.items()
            }
        )
        self.heads = nn.ParameterList([torch.zeros(out, 1, 1) for _, out, _, _, _ in _CONVOLUTIONS.values()])
        self.requires_grad_(False)

    @staticmethod
    def load(backbone: Path, heads: Path) -> Lpips:
        """The network with the weights of two state-dict files.

        The files are read as tensors only: one that holds other objects is refused. Raises anything
        for damaged ones.
        """
        alexnet, linear = _state_dict(backbone), _state_dict(heads)
        network = Lpips()
        for index, layer in network.convolutions.items():
            layer.load_state_dict({kind: alexnet[f"features.{index}.{kind}"] for kind in ("weight", "bias")})
        for level, head in enumerate(network.heads):
            head.copy_(linear[f"lin{level}.model.1.weight"].reshape(head.shape))
        if not all(torch.isfinite(values).all() for values in network.parameters()):
            raise ValueError("they are not all finite")
        return network

    @torch.no_grad()
    def distance(self, a: np.ndarray, b: np.ndarray) -> float:
        """LPIPS of two (H, W, 3) images in [0, 1]; 0 when they are equal."""
        total = 0.0
        for level, (x, y) in enumerate(zip(self._features(a), self._features(b), strict=True)):
            difference = (_normalised(x) - _normalised(y)) ** 2
            total += float((difference * self.heads[level]).sum(dim=1).mean())
        return total

    def _features(self, image: np.ndarray) -> list[torch.Tensor]:
        """The five rectified feature maps, each (1, C, h, w)."""
        pixels = torch.from_numpy(np.ascontiguousarray(image, np.float32)).permute(2, 0, 1)[None]
        values = pixels * 2.0 - 1.0
        values = (values - torch.tensor(_MEAN)[:, None, None]) / torch.tensor(_DEVIATION)[:, None, None]
        maps = []
        for index, layer in self.convolutions.items():
            if int(index) in _POOLED_BEFORE:
                values = nn.functional.max_pool2d(values, kernel_size=3, stride=2)
            values = torch.relu(layer(values))
            maps.append(values)
        return maps


def _state_dict(file: Path) -> dict[str, torch.Tensor]:
    """What a file holds, of its own size: PyTorch packs none, and unpacks what others packed."""
    size = file.stat().st_size
    if zipfile.is_zipfile(file):
        with zipfile.ZipFile(file) as archive:
            if sum(member.file_size for member in archive.infolist()) > size:
                raise ValueError(f"{file.name} is packed")
    if size > _MOST_BYTES:
        raise ValueError(f"{file.name} has {size} bytes, of at most {_MOST_BYTES}")
    tensors: dict[str, torch.Tensor] = torch.load(file, map_location="cpu", weights_only=True)
    return tensors


def _normalised(features: torch.Tensor) -> torch.Tensor:
    """Unit length along the channels, as LPIPS compares features."""
    return features / (features.square().sum(dim=1, keepdim=True).sqrt() + 1e-10)
