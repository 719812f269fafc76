"""Powers of two and binary logarithms of vectors, by polynomials: see ``vectors``."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .vectors import Value


def _fitted_exp2(low: float, high: float) -> list[float]:
    """The polynomial of degree 5 nearest to 2**x in relative error, highest power first."""
    nodes = 0.5 * (low + high) + 0.5 * (high - low) * np.cos((2 * np.arange(64) + 1) * np.pi / 128)
    powers = np.stack([nodes**k for k in range(5, -1, -1)], axis=1)
    values = 2.0**nodes
    solution = np.linalg.lstsq(powers / values[:, None], np.ones_like(values), rcond=None)[0]
    return [float(np.float32(c)) for c in solution]


_EXP2_COEFFICIENTS = _fitted_exp2(-0.5, 0.5)
EXP2_COEFFICIENTS_BELOW_0 = _fitted_exp2(-1.0, 0.0)
"""Of ``exp2_small``."""


def exp2(x: Value) -> Value:
    """2**x for -126 <= x < 127, relative error below 2e-7."""
    code = x.code
    whole = code.rint(x)
    part = x - whole
    result = code.vector(_EXP2_COEFFICIENTS[0])
    for coefficient in _EXP2_COEFFICIENTS[1:]:
        result = result * part + coefficient
    return code.as_floats(code.as_integers(result) + (code.to_integers(whole) << 23))


def exp2_small(eighth: Value, coefficients: Sequence[Value]) -> Value:
    """2**(8 x) for -1 <= x <= 0, relative error below 2e-6: a polynomial, squared three times.

    Shorter than ``exp2``; outside the range the value is finite or inf and means nothing.
    ``coefficients`` are the numbers of EXP2_COEFFICIENTS_BELOW_0.
    """
    result = coefficients[0]
    for coefficient in coefficients[1:]:
        result = eighth.code.fma(result, eighth, coefficient)
    for _ in range(3):
        result = result * result
    return result


def log2(x: Value) -> Value:
    """The binary logarithm of a positive normal float, within 2e-7 beside the result's rounding."""
    code = x.code
    bits = code.as_integers(x)
    exponent = (bits - 0x3F3504F3) >> 23  # the mantissa lies between sqrt(1/2) and sqrt(2)
    mantissa = code.as_floats(bits - (exponent << 23))
    t = (mantissa - 1.0) / (mantissa + 1.0)
    square = t * t
    series = ((square * (2.0 / 9.0) + 2.0 / 7.0) * square + 2.0 / 5.0) * square + 2.0 / 3.0
    log = t * (series * square + 2.0) * (1.0 / math.log(2.0))
    return log + code.to_floats(exponent)
