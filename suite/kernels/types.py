"""The signatures of compiled functions: a model's function, and the arrays that kernels take."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from suite.kernels.cache import numba

types = numba.types

REAL = types.float64
INT = types.int64
VECTOR = types.float64[::1]
MATRIX = types.float64[:, ::1]
CUBE = types.float64[:, :, ::1]
INDICES = types.int64[::1]

# rate(t, x, u, p, on, dx, Fx, Fp) and output(t, x, u, p, on, y, Hx, Hp)
MODEL_FUNCTION = types.void(REAL, VECTOR, VECTOR, VECTOR, INDICES, VECTOR, MATRIX, MATRIX)
MODEL = types.FunctionType(MODEL_FUNCTION)


def arrays(*values: Any) -> tuple[npt.NDArray[np.float64], ...]:
    """The values as a kernel wants them: contiguous numbers."""
    return tuple(np.ascontiguousarray(value, dtype=np.float64) for value in values)
