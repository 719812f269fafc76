from __future__ import annotations

import numpy as np
import pytest
import torch
from photometric import photometric_loss
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from r2sego_blender.splats.metrics import psnr, ssim, ssim_window


def images(height: int, width: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.uniform(size=(height, width, 3)).astype(np.float32)
    return x, np.clip(x + rng.normal(0, 0.1, x.shape), 0, 1).astype(np.float32)


def reference_loss(x: torch.Tensor, y: torch.Tensor, ssim_weight: float) -> tuple[torch.Tensor, torch.Tensor]:
    """The loss and SSIM as the original code computes them, with torch convolutions."""
    window = torch.tensor(ssim_window())
    kernel = (window[:, None] * window[None]).expand(3, 1, 11, 11)

    def blurred(values: torch.Tensor) -> torch.Tensor:
        return torch.nn.functional.conv2d(values.permute(2, 0, 1)[None], kernel, padding=5, groups=3)

    mx, my = blurred(x), blurred(y)
    vx, vy, cov = blurred(x * x) - mx**2, blurred(y * y) - my**2, blurred(x * y) - mx * my
    value = (2 * mx * my + 1e-4) * (2 * cov + 9e-4) / ((mx**2 + my**2 + 1e-4) * (vx + vy + 9e-4))
    return (1 - ssim_weight) * (x - y).abs().mean() + ssim_weight * (1 - value.mean()), value.mean()


@pytest.mark.parametrize(("height", "width"), [(33, 32), (12, 9), (70, 131), (64, 200), (500, 70)])
@pytest.mark.parametrize("ssim_weight", [0.0, 0.2, 1.0])
def test_loss_and_gradient_equal_the_reference(height: int, width: int, ssim_weight: float) -> None:
    x, y = images(height, width)
    leaf = torch.tensor(x, dtype=torch.float64, requires_grad=True)
    expected, similarity = reference_loss(leaf, torch.tensor(y, dtype=torch.float64), ssim_weight)
    expected.backward()
    loss, gradient = photometric_loss(x, y, ssim_weight)
    assert loss == pytest.approx(expected.item(), rel=1e-5)
    assert ssim(x, y) == pytest.approx(similarity.item(), abs=1e-9)
    error = np.linalg.norm(gradient - leaf.grad.numpy()) / np.linalg.norm(leaf.grad.numpy())
    assert error < 1e-5


@pytest.mark.parametrize(("down", "across"), [(0, 7), (9, 0), (200, 64)])
def test_the_gradient_moves_with_the_image_to_the_bit(down: int, across: int) -> None:
    """Bands, strips and lanes begin elsewhere; what they compute is the same."""
    still, moved = np.zeros((2, 2, 600, 200, 3), np.float32)
    still[:, 30:330, 20:100] = images(300, 80)
    moved[:, 30 + down : 330 + down, 20 + across : 100 + across] = still[:, 30:330, 20:100]
    gradients = [photometric_loss(*pair, 0.2)[1] for pair in (still, moved)]
    assert np.abs(gradients[0]).max() > 0
    np.testing.assert_array_equal(np.roll(gradients[0], (down, across), (0, 1)), gradients[1])


def test_equal_images_have_no_loss() -> None:
    x, _ = images(40, 50)
    loss, gradient = photometric_loss(x, x, 0.2)
    assert abs(loss) < 1e-6
    assert np.abs(gradient).max() < 1e-7


def test_metrics_agree_with_scikit_image() -> None:
    x, y = images(60, 70)
    assert psnr(x, y) == pytest.approx(peak_signal_noise_ratio(y, x, data_range=1.0), abs=1e-4)
    inner = structural_similarity(
        x, y, channel_axis=2, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1.0
    )
    assert ssim(x, y) == pytest.approx(inner, abs=0.01)  # it leaves the border out
    assert psnr(x, x) == float("inf")
    assert ssim(x, x) == pytest.approx(1.0)
