"""One sample of x' = f(x, u, t; p) by the model's own unrolled step where there is one, else by `advance`."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core.typing.templates import Signature
from numba.extending import intrinsic

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.integrate import WORK, advance

_NUMBERS = (nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.VECTOR)


@intrinsic
def _unrolled(
    typing_context: Any, address: Any, t: Any, dt: Any, u0: Any, u1: Any, linear: Any, p: Any, columns: Any,
    substeps: Any, x: Any, T: Any,
) -> Any:  # fmt: skip
    """Call the function of `unrolled` at an address, by plain pointers."""
    given = nb.INT, nb.REAL, nb.REAL, *_NUMBERS, nb.INDICES, nb.INT, nb.VECTOR, nb.MATRIX

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def data(k: int) -> Any:
            return context.make_array(given[k])(context, builder, arguments[k]).data

        count = builder.extract_value(context.make_array(nb.INDICES)(context, builder, arguments[7]).shape, 0)
        passed = [arguments[1], arguments[2], *map(data, (3, 4, 5, 6, 7)), count, arguments[8], data(9), data(10)]
        kind = ir.FunctionType(ir.VoidType(), [value.type for value in passed])
        builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), passed)
        return context.get_dummy_value()

    return Signature(nb.types.void, given, None), generate


@compile_kernel(
    nb.types.void(
        nb.INT, nb.MODEL, nb.REAL, nb.REAL, *_NUMBERS, nb.INDICES, nb.INDICES, nb.INT, nb.VECTOR, nb.MATRIX, WORK,
    )
)  # fmt: skip
def step(
    own: int, rate: Any, t: float, dt: float, u0: Any, u1: Any, linear: Any, p: Any, on: Any, columns: Any,
    substeps: int, x: Any, T: Any, work: Any,
) -> None:  # fmt: skip
    """As `advance`; own: the address of the model's own step, good while all gates are off, or 0. Writes x, T, work."""
    if own != 0:
        _unrolled(own, t, dt, u0, u1, linear, p, columns, substeps, x, T)  # pyright: ignore[reportCallIssue]
    else:
        advance(rate, t, dt, u0, u1, linear, p, on, columns, substeps, x, T, work)
