"""Powers of two and binary logarithms of vectors, by polynomials: see ``vectors``."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .vectors import Value


def _fitted_exp2(degree: int, low: float, high: float) -> list[float]:
    """The polynomial nearest to 2**x in relative error, highest power first."""
    nodes = 0.5 * (low + high) + 0.5 * (high - low) * np.cos((2 * np.arange(64) + 1) * np.pi / 128)
    powers = np.stack([nodes**k for k in range(degree, -1, -1)], axis=1)
    values = 2.0**nodes
    solution = np.linalg.lstsq(powers / values[:, None], np.ones_like(values), rcond=None)[0]
    return [float(np.float32(c)) for c in solution]


_EXP2_COEFFICIENTS = _fitted_exp2(5, -0.5, 0.5)

EXP2_COEFFICIENTS_BELOW_0 = _fitted_exp2(5, -1.0, 0.0)
"""Of 2**x for -1 <= x <= 0; squared three times it is 2**(8 x) within 2e-6, without whole numbers."""

_COUNTS_EIGHTHS = 1.5 * 2.0**20
"""Added to a float32 it leaves a sum that counts the nearest eighths in its lowest bits."""

EXP2_OF_EIGHTHS = (*(c * 8.0 ** (4 - k) for k, c in enumerate(_fitted_exp2(4, -0.5, 0.5))), _COUNTS_EIGHTHS)
"""The constants of ``exp2_of_eighths``."""

_MANTISSA_BITS = 23


def exp2(x: Value) -> Value:
    """2**x for -126 <= x < 127, relative error below 2e-7."""
    code = x.code
    whole = code.rint(x)
    part = x - whole
    result = code.vector(_EXP2_COEFFICIENTS[0])
    for coefficient in _EXP2_COEFFICIENTS[1:]:
        result = result * part + coefficient
    return code.as_floats(code.as_integers(result) + (code.to_integers(whole) << _MANTISSA_BITS))


def exp2_of_eighths(eighth: Value, constants: Sequence[Value]) -> Value:
    """2**(8 x) for -15 <= x <= 15, relative error below 4e-6.

    Half of ``exp2``'s multiplications: many processors add in other units than they multiply.
    Outside the range the value means nothing and may be NaN. ``constants`` are the numbers of
    EXP2_OF_EIGHTHS.
    """
    code = eighth.code
    *coefficients, counts = constants
    counted = code.added(eighth, counts)
    part = code.subtracted(eighth, code.subtracted(counted, counts))
    result = coefficients[0]
    for coefficient in coefficients[1:]:
        result = code.fma(result, part, coefficient)
    return code.as_floats(code.as_integers(result) + (code.as_integers(counted) << _MANTISSA_BITS))


def log2(x: Value) -> Value:
    """The binary logarithm of a positive normal float, within 2e-7 beside the result's rounding."""
    code = x.code
    bits = code.as_integers(x)
    exponent = (bits - 0x3F3504F3) >> _MANTISSA_BITS  # the mantissa lies between sqrt(1/2) and sqrt(2)
    mantissa = code.as_floats(bits - (exponent << _MANTISSA_BITS))
    t = (mantissa - 1.0) / (mantissa + 1.0)
    square = t * t
    series = ((square * (2.0 / 9.0) + 2.0 / 7.0) * square + 2.0 / 5.0) * square + 2.0 / 3.0
    log = t * (series * square + 2.0) * (1.0 / math.log(2.0))
    return log + code.to_floats(exponent)
