"""Step functions for generated code: a call evaluates its argument once, where nested text would double it."""

from __future__ import annotations

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel


@compile_kernel(nb.REAL(nb.REAL))
def sign(x: float) -> float:
    """-1, 0 or 1; NaN stays NaN."""
    if x > 0.0:
        return 1.0
    if x < 0.0:
        return -1.0
    return x * 0.0
