"""Splat training in torch with numba kernels: the rasteriser as a differentiable function.

Any torch loss and optimiser can be used on the parameters:

    means = torch.tensor(asset.means, requires_grad=True)
    ...
    colour, alpha, depth = rasterize(means, log_scales, quaternions, logit_opacities, sh, camera)
    loss(colour).backward()
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from ...core.cameras import Camera
from ..asset import SplatAsset
from ..kernels.packing import PackedGaussians
from .rasterizer import SMALLEST_ALPHA, Rasterizer


def rasterize(
    means: torch.Tensor,
    log_scales: torch.Tensor,
    quaternions: torch.Tensor,
    logit_opacities: torch.Tensor,
    sh: torch.Tensor,
    camera: Camera,
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Colour (H, W, 3), alpha (H, W) and depth (H, W) over black, as ``Rendering``.

    The parameters are float32 CPU tensors of the shapes in ``SplatAsset``; all of them get
    gradients, through each of the three results. Results do not share memory with others.
    """
    return _Rasterize.apply(means, log_scales, quaternions, logit_opacities, sh, camera)


class _Rasterize(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any,
        means: torch.Tensor,
        log_scales: torch.Tensor,
        quaternions: torch.Tensor,
        logit_opacities: torch.Tensor,
        sh: torch.Tensor,
        camera: Camera,
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        arrays = [t.detach().numpy() for t in (means, log_scales, quaternions, logit_opacities, sh)]
        ctx.save_for_backward(means, log_scales, quaternions, logit_opacities, sh)
        ctx.rasterizer = Rasterizer()
        ctx.rasterizer.forward(PackedGaussians.of(SplatAsset(*arrays)), camera)
        rendering = ctx.rasterizer.rendering()
        colour, alpha, depth = map(torch.from_numpy, (rendering.colour, rendering.alpha, rendering.depth))
        return colour, alpha, depth

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, g_colour: torch.Tensor, g_alpha: torch.Tensor, g_depth: torch.Tensor) -> tuple:
        _ = ctx.saved_tensors  # raises when a parameter was changed since
        # depth = depth_sum / alpha where alpha is not negligible, else the constant 0.
        alpha = 1.0 - ctx.rasterizer.transmittance
        seen = alpha > SMALLEST_ALPHA
        inverse = np.where(seen, 1.0 / np.maximum(alpha, SMALLEST_ALPHA), 0.0).astype(np.float32)
        g_depth_sum = g_depth.numpy() * inverse
        g_alpha = g_alpha.numpy() - g_depth_sum * ctx.rasterizer.depth_sum * inverse
        gradients = ctx.rasterizer.backward(g_colour.numpy(), g_alpha, g_depth_sum)
        groups = (gradients.means, gradients.log_scales, gradients.quaternions, gradients.logit_opacities, gradients.sh)
        return (*map(torch.from_numpy, groups), None)
