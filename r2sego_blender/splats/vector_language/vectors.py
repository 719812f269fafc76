"""A small language for vector kernels: sixteen float32 lanes on any instruction set.

Numba vectorises a plain loop when it can; the rasteriser's loops are written so that it
need not guess. A function decorated with ``vector_kernel`` does not compute: it is called
once, while a kernel that uses it is compiled, and writes down LLVM instructions on vectors
of sixteen floats. LLVM turns them into one AVX-512 instruction, two of AVX2 or four of
NEON; no instruction set is named here.

    @vector_kernel(void(int64, float32, int64))
    def scale(code, address, factor, count):
        with code.loop(count) as i:
            row = address + i * VECTOR_BYTES
            code.store(row, code.load(row) * factor)

Addresses are int64, from ``array.ctypes.data``; vectors in memory are aligned to their
64 bytes unless said otherwise. Numba takes the arrays of a parallel kernel for disjoint:
within one kernel memory is reached by array or by address, never by both.
"""

from __future__ import annotations

import contextlib
import inspect
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils
from numba.extending import intrinsic

LANES = 16
VECTOR_BYTES = 4 * LANES

_FLOAT, _INT = ir.FloatType(), ir.IntType(32)
_FLOATS, _INTS = ir.VectorType(_FLOAT, LANES), ir.VectorType(_INT, LANES)
_LONG = ir.IntType(64)

# Everything but 'nnan' and 'ninf': a NaN must stay one, so that comparisons reject it.
_FAST = ("nsz", "arcp", "contract", "afn", "reassoc")
_AS_IT_STANDS = ("nsz",)  # Numba gives its own to an operation without any


class Value:
    """An LLVM value with Python's operators: a vector of lanes, or a scalar.

    A number or a scalar float beside a vector is spread over its lanes.
    """

    __slots__ = ("code", "llvm")

    def __init__(self, code: Code, llvm: ir.Value) -> None:
        self.code = code
        self.llvm = llvm

    def __add__(self, other: Any) -> Value:
        return self._binary(other, "fadd", "add")

    def __sub__(self, other: Any) -> Value:
        return self._binary(other, "fsub", "sub")

    def __mul__(self, other: Any) -> Value:
        return self._binary(other, "fmul", "mul")

    def __truediv__(self, other: Any) -> Value:
        return self._binary(other, "fdiv", "sdiv")

    __radd__ = __add__
    __rmul__ = __mul__

    def __rsub__(self, other: Any) -> Value:
        a, b = self.code.matched(other, self)
        return a - b

    def __rtruediv__(self, other: Any) -> Value:
        a, b = self.code.matched(other, self)
        return a / b

    def __neg__(self) -> Value:
        return 0 - self

    def __and__(self, other: Any) -> Value:
        return self._binary(other, None, "and_")

    def __or__(self, other: Any) -> Value:
        return self._binary(other, None, "or_")

    def __lshift__(self, other: Any) -> Value:
        return self._binary(other, None, "shl")

    def __rshift__(self, other: Any) -> Value:
        """Arithmetic shift: the sign is kept."""
        return self._binary(other, None, "ashr")

    def __gt__(self, other: Any) -> Value:
        return self._compare(">", other)

    def __ge__(self, other: Any) -> Value:
        return self._compare(">=", other)

    def __lt__(self, other: Any) -> Value:
        return self._compare("<", other)

    def __le__(self, other: Any) -> Value:
        return self._compare("<=", other)

    def equals(self, other: Any) -> Value:
        return self._compare("==", other)

    def differs(self, other: Any) -> Value:
        return self._compare("!=", other)

    def is_float(self) -> bool:
        kind = self.llvm.type
        return isinstance(kind.element if isinstance(kind, ir.VectorType) else kind, ir.FloatType)

    def lane(self, index: int) -> Value:
        """One lane of a vector, a scalar."""
        return Value(self.code, self.code.builder.extract_element(self.llvm, ir.Constant(_INT, index)))

    def _binary(self, other: Any, on_floats: str | None, on_integers: str) -> Value:
        a, b = self.code.matched(self, other)
        build = self.code.builder
        if a.is_float():
            assert on_floats is not None, "floats have no such operation"
            return Value(self.code, getattr(build, on_floats)(a.llvm, b.llvm, flags=_FAST))
        return Value(self.code, getattr(build, on_integers)(a.llvm, b.llvm))

    def _compare(self, sign: str, other: Any) -> Value:
        a, b = self.code.matched(self, other)
        build = self.code.builder
        compare = build.fcmp_ordered if a.is_float() else build.icmp_signed
        return Value(self.code, compare(sign, a.llvm, b.llvm))


class Variable:
    """A value that loops change; LLVM keeps it in a register."""

    def __init__(self, code: Code, start: Value) -> None:
        self._code = code
        self._slot = cgutils.alloca_once(code.builder, start.llvm.type)
        self.set(start)

    def get(self) -> Value:
        return Value(self._code, self._code.builder.load(self._slot))

    def set(self, value: Value) -> None:
        self._code.builder.store(value.llvm, self._slot)

    def add(self, value: Value) -> None:
        self.set(self.get() + value)


class Code:
    """The kernel being written: memory, functions and control flow."""

    def __init__(self, builder: ir.IRBuilder) -> None:
        self.builder = builder

    # -- values

    def vector(self, values: float | Sequence[float]) -> Value:
        """A constant vector of floats: one number in every lane, or sixteen."""
        lanes: Any = [values] * LANES if np.isscalar(values) else values
        return Value(self, ir.Constant(_FLOATS, [float(np.float32(v)) for v in lanes]))

    def integers(self, values: int | Sequence[int]) -> Value:
        """A constant vector of int32."""
        lanes: Any = [values] * LANES if np.isscalar(values) else values
        return Value(self, ir.Constant(_INTS, [int(v) for v in lanes]))

    def long(self, value: int) -> Value:
        """A constant int64."""
        return Value(self, ir.Constant(_LONG, value))

    def float(self, value: float) -> Value:
        """A constant scalar float32."""
        return Value(self, ir.Constant(_FLOAT, float(np.float32(value))))

    def spread(self, scalar: Value) -> Value:
        """A scalar in every lane."""
        kind = ir.VectorType(scalar.llvm.type, LANES)
        nothing = ir.Constant(kind, ir.Undefined)
        first = self.builder.insert_element(nothing, scalar.llvm, ir.Constant(_INT, 0))
        return Value(self, self.builder.shuffle_vector(first, nothing, ir.Constant(_INTS, [0] * LANES)))

    def matched(self, a: Any, b: Any) -> tuple[Value, Value]:
        """Both as values of one type: numbers become constants, scalars fill vectors."""
        if not isinstance(a, Value):
            b, a = self.matched(b, a)
            return a, b
        if not isinstance(b, Value):
            kind = a.llvm.type
            number = float(np.float32(b)) if a.is_float() else int(b)
            content = [number] * LANES if isinstance(kind, ir.VectorType) else number
            return a, Value(self, ir.Constant(kind, content))
        wide_a, wide_b = (isinstance(v.llvm.type, ir.VectorType) for v in (a, b))
        if wide_a and not wide_b:
            b = self.spread(b)
        elif wide_b and not wide_a:
            a = self.spread(a)
        return a, b

    def with_lane(self, vector: Value, lane: int, scalar: Value) -> Value:
        """The vector with one lane replaced."""
        return Value(self, self.builder.insert_element(vector.llvm, scalar.llvm, ir.Constant(_INT, lane)))

    def variable(self, start: Value) -> Variable:
        return Variable(self, start)

    # -- memory

    def load(self, address: Value, aligned: bool = True) -> Value:
        """Sixteen floats."""
        pointer = self.builder.inttoptr(address.llvm, _FLOATS.as_pointer())
        return Value(self, self.builder.load(pointer, align=VECTOR_BYTES if aligned else 4))

    def store(self, address: Value, value: Value, aligned: bool = True) -> None:
        pointer = self.builder.inttoptr(address.llvm, value.llvm.type.as_pointer())
        self.builder.store(value.llvm, pointer, align=VECTOR_BYTES if aligned else 4)

    def load_float(self, address: Value) -> Value:
        """One float; beside vectors it fills their lanes."""
        return Value(self, self.builder.load(self.builder.inttoptr(address.llvm, _FLOAT.as_pointer())))

    def store_float(self, address: Value, value: Value) -> None:
        self.builder.store(value.llvm, self.builder.inttoptr(address.llvm, _FLOAT.as_pointer()))

    def load_long(self, address: Value) -> Value:
        """One int64."""
        return Value(self, self.builder.load(self.builder.inttoptr(address.llvm, _LONG.as_pointer())))

    def load_int(self, address: Value) -> Value:
        """One int32, as int64."""
        value = self.builder.load(self.builder.inttoptr(address.llvm, _INT.as_pointer()))
        return Value(self, self.builder.sext(value, _LONG))

    def store_long(self, address: Value, value: Value) -> None:
        self.builder.store(value.llvm, self.builder.inttoptr(address.llvm, _LONG.as_pointer()))

    def prefetch(self, address: Value, write: bool = False) -> None:
        """Ask for the cache line at ``address``, to be read or written soon."""
        byte = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [byte, _INT, _INT, _INT])
        call = cgutils.get_or_insert_function(self.builder.module, kind, "llvm.prefetch.p0i8")
        read, keep, data = (ir.Constant(_INT, n) for n in (int(write), 3, 1))
        self.builder.call(call, [self.builder.inttoptr(address.llvm, byte), read, keep, data])

    # -- functions

    def select(self, mask: Value, a: Any, b: Any) -> Value:
        """``a`` where ``mask`` holds, else ``b``."""
        if isinstance(a, Value) or isinstance(b, Value):
            a, b = self.matched(a, b)
        else:
            a, b = self.vector(a), self.vector(b)
        return Value(self, self.builder.select(mask.llvm, a.llvm, b.llvm))

    def minimum(self, a: Any, b: Any) -> Value:
        """The smaller; ``b`` where ``a`` is NaN."""
        a, b = self.matched(a, b)
        return self.select(a < b, a, b)

    def maximum(self, a: Any, b: Any) -> Value:
        """The larger; ``b`` where ``a`` is NaN."""
        a, b = self.matched(a, b)
        return self.select(a > b, a, b)

    def fma(self, a: Any, b: Any, c: Any) -> Value:
        """a b + c in one instruction; sums written so are not put into another order."""
        a, b = self.matched(a, b)
        a, c = self.matched(a, c)
        b, c = self.matched(b, c)
        kind = ir.FunctionType(a.llvm.type, [a.llvm.type] * 3)
        function = cgutils.get_or_insert_function(self.builder.module, kind, f"llvm.fma.{_suffix(a)}")
        return Value(self, self.builder.call(function, [a.llvm, b.llvm, c.llvm], fastmath=_FAST))

    def added(self, a: Any, b: Any) -> Value:
        """a + b as it stands: not put into another order with other sums, so that its rounding counts."""
        a, b = self.matched(a, b)
        return Value(self, self.builder.fadd(a.llvm, b.llvm, flags=_AS_IT_STANDS))

    def subtracted(self, a: Any, b: Any) -> Value:
        """a - b as it stands; see ``added``."""
        a, b = self.matched(a, b)
        return Value(self, self.builder.fsub(a.llvm, b.llvm, flags=_AS_IT_STANDS))

    def quotient(self, a: Any, b: Any) -> Value:
        """a / b as it stands: divided where others multiply, not estimated and refined by multiplications."""
        a, b = self.matched(a, b)
        return Value(self, self.builder.fdiv(a.llvm, b.llvm, flags=_AS_IT_STANDS))

    def sqrt(self, x: Value) -> Value:
        return self._call(f"llvm.sqrt.{_suffix(x)}", x)

    def absolute(self, x: Value) -> Value:
        return self._call(f"llvm.fabs.{_suffix(x)}", x)

    def rint(self, x: Value) -> Value:
        """The nearest whole number, of two the even one, as floats."""
        return self._call(f"llvm.rint.{_suffix(x)}", x)

    def to_integers(self, x: Value) -> Value:
        """Towards zero; NaN and values out of range give anything."""
        return Value(self, self.builder.fptosi(x.llvm, _INTS))

    def to_floats(self, x: Value) -> Value:
        """Of int32 lanes, or of a scalar int64."""
        kind = _FLOATS if isinstance(x.llvm.type, ir.VectorType) else _FLOAT
        return Value(self, self.builder.sitofp(x.llvm, kind))

    def to_long(self, x: Value) -> Value:
        """A scalar float towards zero, as int64."""
        return Value(self, self.builder.fptosi(x.llvm, _LONG))

    def as_floats(self, x: Value) -> Value:
        """The bits of int32 lanes, to be stored beside floats."""
        return Value(self, self.builder.bitcast(x.llvm, _FLOATS))

    def as_integers(self, x: Value) -> Value:
        """The bits of floats, as int32 lanes; of positive ones they have the floats' order."""
        return Value(self, self.builder.bitcast(x.llvm, _INTS))

    def to_int(self, x: Value) -> Value:
        """The low half of an int64, to stand beside int32 lanes."""
        return Value(self, self.builder.trunc(x.llvm, _INT))

    def bits(self, mask: Value) -> Value:
        """A mask of lanes as the low bits of an int64."""
        return Value(self, self.builder.zext(self.builder.bitcast(mask.llvm, ir.IntType(LANES)), _LONG))

    def bytes_of(self, integers: Value) -> tuple[Value, Value]:
        """The lowest bytes of sixteen int32 lanes, as two int64 of eight bytes."""
        narrow = self.builder.trunc(integers.llvm, ir.VectorType(ir.IntType(8), LANES))
        pair = Value(self, self.builder.bitcast(narrow, ir.VectorType(_LONG, 2)))
        return pair.lane(0), pair.lane(1)

    def trailing_zeros(self, x: Value) -> Value:
        """Of a non-zero int64."""
        kind = ir.FunctionType(_LONG, [_LONG, ir.IntType(1)])
        call = cgutils.get_or_insert_function(self.builder.module, kind, "llvm.cttz.i64")
        return Value(self, self.builder.call(call, [x.llvm, ir.Constant(ir.IntType(1), 1)]))

    def shuffled(self, a: Value, b: Value, order: Sequence[int]) -> Value:
        """Lanes of ``a`` and ``b`` by their numbers: those of ``b`` go on after those of ``a``."""
        mask = ir.Constant(ir.VectorType(_INT, len(order)), list(order))
        return Value(self, self.builder.shuffle_vector(a.llvm, b.llvm, mask))

    def cut(self, x: Value, lanes: int) -> list[Value]:
        """A vector as several of ``lanes`` each, for sums that shall stay in narrow registers.

        Of these, operators and ``fma`` take two or three of one width.
        """
        return [self.shuffled(x, x, range(k, k + lanes)) for k in range(0, LANES, lanes)]

    def padded(self, part: Value) -> Value:
        """What ``cut`` gave as a whole vector again, with zeros."""
        lanes = part.llvm.type.count
        zeros = Value(self, ir.Constant(part.llvm.type, [0.0] * lanes))
        return self.shuffled(part, zeros, [min(k, lanes) for k in range(LANES)])

    # -- control flow

    @contextlib.contextmanager
    def loop(self, count: Value, start: Value | None = None) -> Iterator[Value]:
        """The body runs for an int64 from ``start`` (default 0) below ``count``."""
        index = self.variable(self.long(0) if start is None else start)
        with self.loop_while(lambda: index.get() < count):
            yield index.get()
            index.add(self.long(1))

    @contextlib.contextmanager
    def loop_bits(self, bits: Value) -> Iterator[Value]:
        """The body runs for the number of each set bit of an int64, from the lowest."""
        rest = self.variable(bits)
        with self.loop_while(lambda: rest.get().differs(0)):
            now = rest.get()
            rest.set(now & (now - 1))
            yield self.trailing_zeros(now)

    @contextlib.contextmanager
    def loop_while(self, condition: Callable[[], Value]) -> Iterator[None]:
        """The body runs as long as the condition, written anew each time, holds."""
        build = self.builder
        test, body, after = (build.append_basic_block(name) for name in ("test", "body", "after"))
        build.branch(test)
        build.position_at_end(test)
        build.cbranch(condition().llvm, body, after)
        build.position_at_end(body)
        yield
        build.branch(test)
        build.position_at_end(after)

    @contextlib.contextmanager
    def when(self, condition: Value) -> Iterator[None]:
        """The body runs if the scalar condition holds."""
        with self.builder.if_then(condition.llvm):
            yield

    def _call(self, name: str, x: Value) -> Value:
        kind = ir.FunctionType(x.llvm.type, [x.llvm.type])
        function = cgutils.get_or_insert_function(self.builder.module, kind, name)
        return Value(self, self.builder.call(function, [x.llvm], fastmath=_FAST))


def vector_kernel(signature: Any) -> Callable[[Callable[..., Value | None]], Any]:
    """Make a function of kernels from one that writes code; see the module's text.

    ``signature`` is a Numba signature of int32, int64 and float32 scalars, such as
    ``void(int64, float32)``. The decorated function gets a ``Code`` and a ``Value`` for
    each argument, and returns a ``Value`` unless the signature's return type is void.
    """

    def decorate(write: Callable[..., Value | None]) -> Any:
        def emit(context: Any, builder: ir.IRBuilder, _: Any, arguments: Sequence[ir.Value]) -> Any:
            code = Code(builder)
            result = write(code, *(Value(code, argument) for argument in arguments))
            return context.get_dummy_value() if result is None else result.llvm

        def definition(typing: Any, *arguments: Any) -> Any:
            return signature, emit

        # Numba asks for the parameters one by one, not as a tuple.
        names = ("typing", *list(inspect.signature(write).parameters)[1:])
        positional = inspect.Parameter.POSITIONAL_OR_KEYWORD
        parameters = [inspect.Parameter(n, positional) for n in names]
        vars(definition)["__signature__"] = inspect.Signature(parameters)
        definition.__name__ = definition.__qualname__ = write.__name__
        definition.__doc__ = write.__doc__
        return intrinsic(definition)

    return decorate


def _suffix(x: Value) -> str:
    return f"v{x.llvm.type.count}f32" if isinstance(x.llvm.type, ir.VectorType) else "f32"
