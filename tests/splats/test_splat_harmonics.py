from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from splat_reference import harmonics

from r2sego_blender.splats.harmonics import basis, direction_gradient, rotated_coefficients


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


@pytest.mark.parametrize("degree", (1, 2, 3))
def test_the_direction_gradient_is_that_of_the_basis(degree: int) -> None:
    weights = np.random.default_rng(1).normal(size=16).astype(np.float32)
    for row in directions(10):
        d = torch.tensor(row, requires_grad=True)
        # differentiate the polynomial in which |d| = 1 is not used: the projected gradient agrees
        value = harmonics(d[None], degree)[0] @ torch.from_numpy(weights[: (degree + 1) ** 2]).double()
        value.backward()
        ours = np.array(direction_gradient.py_func(*row, (degree + 1) ** 2, weights))
        tangent = np.eye(3) - np.outer(row, row)
        np.testing.assert_allclose(tangent @ ours, tangent @ d.grad.numpy(), atol=1e-5)
