"""Work on each set bit in stages, those of neighbouring bits side by side: see ``vectors``."""

from __future__ import annotations

from collections.abc import Callable

from .vectors import Value, Variable


def in_stages(
    bits: Value,
    start: Callable[[Value], list[Value]],
    go_on: Callable[[list[Value]], list[Value]],
    finish: Callable[[list[Value]], None],
) -> None:
    """``finish(go_on(start(bit)))`` for each set bit, the stages of neighbours side by side.

    One bit after the other is a chain of operations longer than processors look ahead.
    """
    code = bits.code

    def set_all(variables: list[Variable], values: list[Value]) -> None:
        for variable, value in zip(variables, values, strict=True):
            variable.set(value)

    def get_all(variables: list[Variable]) -> list[Value]:
        return [variable.get() for variable in variables]

    with code.when(bits.differs(0)):
        started = [code.variable(x) for x in start(code.trailing_zeros(bits))]
        gone_on = [code.variable(x) for x in go_on(get_all(started))]
        rest = bits & (bits - 1)
        with code.when(rest.differs(0)):
            set_all(started, start(code.trailing_zeros(rest)))
            with code.loop_bits(rest & (rest - 1)) as bit:
                third, second = start(bit), go_on(get_all(started))
                finish(get_all(gone_on))
                set_all(gone_on, second)
                set_all(started, third)
            second = go_on(get_all(started))
            finish(get_all(gone_on))
            set_all(gone_on, second)
        finish(get_all(gone_on))
