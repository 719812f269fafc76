from __future__ import annotations

import pytest

from r2sego_blender.splats.vector_language.registers import REGISTER_LANES, register_lanes


@pytest.mark.parametrize(
    ("features", "lanes"),
    [
        ("+sse4.2,+avx,+avx2,+avx512f,+avx512vl", 16),
        ("+sse4.2,+avx,+avx2,-avx512f,-avx512vl", 8),
        ("+sse4.2,-avx,-avx10.1,-avx512f", 4),
        ("+neon,+fp-armv8", 4),
        ("", 4),
    ],
)
def test_the_width_of_registers_follows_from_features(features: str, lanes: int) -> None:
    assert register_lanes(features) == lanes


def test_a_vector_is_a_whole_number_of_registers() -> None:
    assert 16 % REGISTER_LANES == 0
