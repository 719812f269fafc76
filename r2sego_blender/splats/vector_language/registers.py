"""How wide this processor's vector registers are, for what is written one way or the other by it.

Vectors have sixteen lanes everywhere (``vectors``); LLVM puts each into one register or into
several. Kernels give the same results either way, but for the order in which lanes are added.
"""

from __future__ import annotations

from numba.core.registry import cpu_target

_LANES = (("avx512f", 16), ("avx", 8))
"""LLVM's name of a feature, and float32 lanes of a register; of all other processors four."""
_FEWEST_LANES = 4


def register_lanes(features: str) -> int:
    """float32 lanes of a register, by a processor's features as LLVM lists them: ``+avx,-avx512f``."""
    there = features.split(",")
    return next((lanes for name, lanes in _LANES if f"+{name}" in there), _FEWEST_LANES)


REGISTER_LANES = register_lanes(cpu_target.target_context.codegen().magic_tuple()[2])
"""Of the processor that kernels are compiled for here. With sixteen there are 32 registers; with
fewer they hold eight whole vectors in all."""
