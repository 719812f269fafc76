"""Whether this thread's kernels count with numbers below 1e-38, or take them for 0."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

_STATE = ir.IntType(32)


@intrinsic
def flush_denormals(typing: Any) -> Any:
    """Let this thread take numbers below 1e-38 for 0: they cost a hundred times the others.

    Returns the former state for ``restore_denormals``. Where the processor is not known,
    nothing happens and kernels are only slower.
    """

    def emit(context: Any, builder: ir.IRBuilder, _: Any, __: Any) -> ir.Value:
        if not _is_x86(builder):
            return ir.Constant(_STATE, 0)
        slot, pointer = _control_register(builder)
        _control(builder, "stmxcsr", pointer)
        before = builder.load(slot)
        flush_to_zero, denormals_are_zero = 0x8000, 0x0040
        builder.store(builder.or_(before, ir.Constant(_STATE, flush_to_zero | denormals_are_zero)), slot)
        _control(builder, "ldmxcsr", pointer)
        return before

    return types.int32(), emit


@intrinsic
def restore_denormals(typing: Any, state: Any) -> Any:
    """Undo ``flush_denormals``."""

    def emit(context: Any, builder: ir.IRBuilder, _: Any, arguments: Sequence[ir.Value]) -> Any:
        if _is_x86(builder):
            slot, pointer = _control_register(builder)
            builder.store(arguments[0], slot)
            _control(builder, "ldmxcsr", pointer)
        return context.get_dummy_value()

    return types.void(types.int32), emit


def _is_x86(builder: ir.IRBuilder) -> bool:
    return builder.module.triple.startswith(("x86", "i686", "amd64"))


def _control_register(builder: ir.IRBuilder) -> tuple[ir.Value, ir.Value]:
    slot = cgutils.alloca_once(builder, _STATE)
    return slot, builder.bitcast(slot, ir.IntType(8).as_pointer())


def _control(builder: ir.IRBuilder, name: str, pointer: ir.Value) -> None:
    kind = ir.FunctionType(ir.VoidType(), [pointer.type])
    builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.x86.sse.{name}"), [pointer])
