"""Changes of ONNX networks: bytes, and nodes that ask for more than any machine has."""

from __future__ import annotations

from random import Random

from ..seeds import OBSERVATIONS, of_tests
from .raw import changed_bytes


def changed_onnx(data: bytes, rng: Random) -> tuple[bytes, str]:
    """A network with its bytes changed, or one that is made to ask for much."""
    if rng.random() < 0.9:
        return changed_bytes(data, rng)
    policies = of_tests("hostile_policies")
    build, size, told = rng.choice(
        (
            (policies.constant_of_shape, 1 << 62, "a constant of 2^62"),
            (policies.constant_of_shape, 1 << 31, "a constant of 2^31"),
            (policies.constant_of_shape, rng.randrange(1 << 28), "a large constant"),
            (policies.looping, 1 << 62, "a loop of 2^62"),
        )
    )
    return build(size, OBSERVATIONS), told
