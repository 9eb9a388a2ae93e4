"""A model's compiled functions along a path: one call for all samples of a record."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.types import arrays
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]


@compile_kernel(
    nb.types.void(
        nb.MODEL, nb.VECTOR, nb.MATRIX, nb.MATRIX, nb.VECTOR, nb.INDICES, nb.MATRIX, nb.MATRIX, nb.CUBE
    )
)  # fmt: skip
def _states(function: Any, t: Any, X: Any, u: Any, p: Any, on: Any, by_p: Any, values: Any, by_x: Any) -> None:
    """Write values (N, rows), by_x (N, rows, n), which start at zero, and by_p (rows, parameters), scratch."""
    for k in range(t.shape[0]):
        function(t[k], X[k], u[k], p, on, values[k], by_x[k], by_p)


@compile_kernel(
    nb.types.void(
        nb.MODEL, nb.VECTOR, nb.MATRIX, nb.MATRIX, nb.VECTOR, nb.INDICES, nb.INT, nb.INDICES, nb.VECTOR, nb.MATRIX,
        nb.MATRIX, nb.MATRIX,
    )
)  # fmt: skip
def _columns(
    function: Any, t: Any, X: Any, u: Any, p: Any, on: Any, row: int, columns: Any, value: Any, by_x: Any, by_p: Any,
    wanted: Any,
) -> None:  # fmt: skip
    """Write wanted (N, columns): the derivatives of one row by some parameters; value, by_x, by_p are scratch."""
    for k in range(t.shape[0]):
        function(t[k], X[k], u[k], p, on, value, by_x, by_p)
        for j in range(columns.shape[0]):
            wanted[k, j] = by_p[row, columns[j]]


def outputs(model: Model, record: Record, X: Array) -> tuple[Array, Array]:
    """h (N, outputs) and dh/dx (N, outputs, n) at the states X (N, n), one for each sample of the record."""
    program = model.program
    points = _points(model, record, X)
    h = np.zeros((len(record), program.outputs_count))
    H = np.zeros((*h.shape, program.n))
    scratch = np.zeros((program.outputs_count, program.parameters))
    _states(program.output, *points, program.all_off(), scratch, h, H)
    return h, H


def residuals(model: Model, record: Record, X: Array) -> tuple[Array, Array]:
    """z - h (N, outputs) at the states X (N, n), those of angles within +-pi; and dh/dx (N, outputs, n)."""
    h, H = outputs(model, record, X)
    gap = record.y - h
    wrapped = np.remainder(gap + np.pi, 2.0 * np.pi) - np.pi
    return np.where(model.angles > 0.0, wrapped, gap), H


def rate_slopes(model: Model, record: Record, X: Array, row: int, columns: npt.ArrayLike) -> Array:
    """The derivatives (N, columns) of the rate in one row by the parameters at `columns`, at the states X (N, n)."""
    program = model.program
    points = _points(model, record, X)
    chosen = np.ascontiguousarray(columns, dtype=np.int64)
    found = np.zeros((len(record), len(chosen)))
    scratch = np.zeros(program.n), np.zeros((program.n, program.n)), np.zeros((program.n, program.parameters))
    _columns(program.rate, *points, program.all_off(), row, chosen, *scratch, found)
    return found


def _points(model: Model, record: Record, X: Array) -> tuple[Array, ...]:
    """Times, states, inputs and parameters; the machine code does not look how many there are."""
    for what, values, names in (("states", X, model.states), ("inputs", record.u, model.inputs)):
        if values.shape != (len(record), len(names)):
            raise ValueError(f"expected {what} of the shape {(len(record), len(names))}, got {values.shape}")
    return arrays(record.t, X, record.u, model.values)
