from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from splat_reference import harmonics

from r2sego_blender.splats.harmonics import basis, basis_gradients, basis_values, rotated_coefficients


def directions(count: int) -> np.ndarray:
    vectors = np.random.default_rng(0).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize("degree", range(4))
def test_the_basis_is_the_textbook_one(degree: int) -> None:
    d = directions(50)
    np.testing.assert_allclose(basis(d, degree), harmonics(torch.from_numpy(d), degree), atol=1e-6)


def test_the_basis_is_orthonormal() -> None:
    d = directions(200_000)
    gram = 4.0 * np.pi * basis(d, 3).T @ basis(d, 3) / len(d)
    np.testing.assert_allclose(gram, np.eye(16), atol=0.03)


@pytest.mark.parametrize("degree", range(4))
def test_rotated_coefficients_describe_the_turned_function(degree: int) -> None:
    rng = np.random.default_rng(degree)
    sh = rng.normal(size=(7, (degree + 1) ** 2, 3)).astype(np.float32)
    rotation, d = Rotation.random(random_state=degree).as_matrix(), directions(30)
    original = np.einsum("dk,nkc->dnc", basis(d, degree), sh)
    turned = np.einsum("dk,nkc->dnc", basis(d @ rotation.T, degree), rotated_coefficients(sh, rotation))
    np.testing.assert_allclose(turned, original, atol=1e-5)


def test_the_direction_gradients_are_those_of_the_basis() -> None:
    d = torch.tensor(directions(20), requires_grad=True)
    values = harmonics_along(d)
    for k, slopes in enumerate(basis_gradients(*d.detach().numpy().T)):
        expected = torch.autograd.grad(values[k].sum(), d, retain_graph=True, allow_unused=True)[0]
        for axis, slope in enumerate(slopes):
            ours = np.zeros(20) if slope is None else np.broadcast_to(slope, 20)
            wanted = np.zeros(20) if expected is None else expected[:, axis].numpy()
            np.testing.assert_allclose(ours, wanted, atol=1e-12)


def harmonics_along(d: torch.Tensor) -> list[torch.Tensor]:
    """The basis as torch values; the constant one keeps its graph."""
    values = basis_values(*d.unbind(-1))
    return [values[0] + 0.0 * d[:, 0], *values[1:]]
