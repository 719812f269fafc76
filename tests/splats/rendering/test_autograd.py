from __future__ import annotations

import numpy as np
import pytest
import torch
from splat_reference import parameters, random_asset, small_camera
from splat_reference import rasterize as reference

from r2sego_blender.splats.rendering.autograd import rasterize
from r2sego_blender.splats.rendering.rasterizer import render


def test_results_and_gradients_equal_the_reference() -> None:
    asset, camera = random_asset(np.random.default_rng(1)), small_camera()
    leaves = parameters(asset)
    colour, alpha, depth_sum = reference(*leaves, camera)
    depth = depth_sum / alpha.clamp(min=1e-3)
    mask = (alpha.detach() > 0.05).double()
    ((colour**2).sum() + (alpha**2).sum() + (mask * depth**2).sum()).backward()
    ours = [leaf.detach().float().requires_grad_() for leaf in leaves]
    colour, alpha, depth = rasterize(*ours, camera)
    np.testing.assert_array_equal(colour.detach().numpy(), render(asset, camera).colour)
    ((colour**2).sum() + (alpha**2).sum() + (mask.float() * depth**2).sum()).backward()
    for a, b in zip(ours, leaves, strict=True):
        assert (a.grad - b.grad).norm() < 1e-4 * b.grad.norm()


def test_a_torch_optimiser_lowers_the_loss() -> None:
    rng = np.random.default_rng(2)
    asset, camera = random_asset(rng, degree=0), small_camera()
    target = torch.from_numpy(render(asset, camera).colour)
    leaves = [leaf.detach().float().requires_grad_() for leaf in parameters(asset)]
    with torch.no_grad():
        leaves[4] += torch.from_numpy(rng.normal(scale=0.3, size=asset.sh.shape)).float()
    optimiser = torch.optim.Adam([{"params": leaves[:4], "lr": 1e-4}, {"params": leaves[4:], "lr": 0.05}])
    losses = []
    for _ in range(30):
        optimiser.zero_grad()
        loss = (rasterize(*leaves, camera)[0] - target).square().mean()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[-1] < 0.2 * losses[0]


def test_parameters_changed_before_the_backward_pass_are_noticed() -> None:
    asset, camera = random_asset(np.random.default_rng(1)), small_camera()
    leaves = [leaf.detach().float().requires_grad_() for leaf in parameters(asset)]
    colour, _, _ = rasterize(*leaves, camera)
    with torch.no_grad():
        leaves[0] += 1.0
    with pytest.raises(RuntimeError, match="modified by an inplace operation"):
        colour.sum().backward()
