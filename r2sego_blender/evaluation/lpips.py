"""LPIPS-Alex (Zhang et al., 2018), when its weights are at hand.

Two files are needed, which this project does not ship: AlexNet's state dict as torchvision
names it (``alexnet-*.pth``) and the linear heads of version 0.1 (``lpips_lin_alex*.pth``
or ``alex.pth``). A person puts both into a folder and names it in the environment variable
``R2SEGO_LPIPS_WEIGHTS``. Without them the score is None, never a substitute.
"""

from __future__ import annotations

import os
import pickle
from pathlib import Path

import numpy as np
import torch
from torch import nn

WEIGHTS_VARIABLE = "R2SEGO_LPIPS_WEIGHTS"
BACKBONE_NAMES = ("alexnet*.pth",)
HEADS_NAMES = ("lpips_lin_alex*.pth", "alex.pth")

_CONVOLUTIONS = {0: (3, 64, 11, 4, 2), 3: (64, 192, 5, 1, 2), 6: (192, 384, 3, 1, 1),
                 8: (384, 256, 3, 1, 1), 10: (256, 256, 3, 1, 1)}  # fmt: skip
"""AlexNet's layers by torchvision's index: channels in and out, kernel, stride, padding."""

_POOLED_BEFORE = frozenset({3, 6})
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

        The files are read as tensors only: one that holds other objects is refused. Raises
        OSError, KeyError, RuntimeError, ValueError or ``pickle.UnpicklingError``.
        """
        alexnet = torch.load(backbone, map_location="cpu", weights_only=True)
        linear = torch.load(heads, map_location="cpu", weights_only=True)
        network = Lpips()
        for index, layer in network.convolutions.items():
            layer.load_state_dict({kind: alexnet[f"features.{index}.{kind}"] for kind in ("weight", "bias")})
        for level, head in enumerate(network.heads):
            head.copy_(linear[f"lin{level}.model.1.weight"].reshape(head.shape))
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


def find_lpips(folder: Path | None = None) -> tuple[Lpips | None, str]:
    """LPIPS with the weights of ``folder`` (or of R2SEGO_LPIPS_WEIGHTS), or None and why."""
    if folder is None:
        named = os.environ.get(WEIGHTS_VARIABLE)
        if not named:
            return None, f"AlexNet weights not at hand (name their folder in {WEIGHTS_VARIABLE})"
        folder = Path(named)
    backbone, heads = _first(folder, BACKBONE_NAMES), _first(folder, HEADS_NAMES)
    if backbone is None:
        return None, f"AlexNet weights not at hand (no {BACKBONE_NAMES[0]} in {folder})"
    if heads is None:
        return None, f"LPIPS heads not at hand (no {' or '.join(HEADS_NAMES)} in {folder})"
    try:
        return Lpips.load(backbone, heads), ""
    except (
        OSError,
        EOFError,
        KeyError,
        RuntimeError,
        ValueError,
        TypeError,
        pickle.UnpicklingError,
    ) as error:
        first_line = (str(error).splitlines() or [type(error).__name__])[0]
        return None, f"LPIPS weights in {folder} cannot be used: {first_line}"


def _normalised(features: torch.Tensor) -> torch.Tensor:
    """Unit length along the channels, as LPIPS compares features."""
    return features / (features.square().sum(dim=1, keepdim=True).sqrt() + 1e-10)


def _first(folder: Path, patterns: tuple[str, ...]) -> Path | None:
    found = (path for pattern in patterns for path in sorted(folder.glob(pattern)) if path.is_file())
    return next(found, None)
