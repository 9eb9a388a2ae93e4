"""Step functions for generated code: a call evaluates its argument once, where nested text would double it."""

from __future__ import annotations

import math

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


@compile_kernel(nb.REAL(nb.REAL, nb.REAL))
def tame_power(x: float, w: float) -> float:
    """x^w for a slope: zero where x is zero or below."""
    return x**w if x > 0.0 else 0.0


@compile_kernel(nb.REAL(nb.REAL))
def tame_log(x: float) -> float:
    """log x for a slope: zero where x is zero or below."""
    return math.log(x) if x > 0.0 else 0.0
