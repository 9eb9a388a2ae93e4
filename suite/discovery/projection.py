"""What is left of errors and of candidates' columns once first states and parameters have taken what they can."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from suite.discovery.engine import Pass, Problem
from suite.discovery.frame import Index

Array = npt.NDArray[np.float64]


def projected(problem: Problem, passed: Pass, own: Index, width: int, prior: bool = True) -> tuple[Array, Array, Array]:
    """The error and the candidates' columns with initial states and parameters projected out (prior rows included).

    Returns r (M + priors,), B (M + priors, candidates), and the candidates' columns before, (M, candidates).
    """
    A, C, e = passed.J[:, :width], passed.J[:, width:], passed.e
    noise = problem.noise(passed)
    sd = problem.prior[1][own]
    if passed.rows is not None:
        # A run's first states meet only the rows of that run.
        free, left = width - len(own), np.column_stack([passed.J[:, width - len(own) :], e])
        for first, last in pairwise(passed.rows):
            U = _basis(passed.J[first:last, :free])
            left[first:last] -= U @ (U.T @ left[first:last])
        A, B, e, width = left[:, : len(own)], left[:, len(own) : -1], left[:, -1], len(own)
    else:
        B = C
    rows = np.zeros((len(own), width))
    informed = np.isfinite(sd) if prior else np.zeros(len(sd), dtype=bool)
    rows[np.arange(len(own)), width - len(own) + np.arange(len(own))] = np.where(
        informed, np.sqrt(noise) / np.where(informed, sd, 1.0), 0.0
    )
    U = _basis(np.vstack([A, rows]))
    whole = np.vstack([np.column_stack([e, B]), np.zeros((len(own), 1 + C.shape[1]))])
    whole = whole - U @ (U.T @ whole)
    return whole[:, 0], whole[:, 1:], C


def _basis(A: Array) -> Array:
    """An orthonormal basis of the columns of A."""
    norms = np.sqrt((A**2).sum(axis=0))
    A = A[:, norms > 0] / norms[norms > 0]
    values, vectors = np.linalg.eigh(A.T @ A)
    kept = values > 1e-14 * values.max(initial=0.0)
    return np.asarray(A @ (vectors[:, kept] / np.sqrt(values[kept])))
