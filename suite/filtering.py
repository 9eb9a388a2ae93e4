"""The extended Kalman filter of a model over a run; a filter's last finite values, and its jumps as rates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from suite.kernels.integrate import workspace
from suite.kernels.jumps import jump_workspace, rates_from_jumps
from suite.kernels.kalman import ekf, ekf_workspace
from suite.kernels.types import arrays
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Filtered:
    """One pass over N samples of n states and m channels.

    x, x_prior (N, n); P, P_prior (N, n, n); Phi, Qd (N, n, n): transition and process noise of the step that ends at
    a sample; H, K (N, m, n); innovation, variance (N, m): of the channels one after another, 0 and 1 where missing;
    seen (N, m): what was measured; R (m,): the sensors' variances;
    failed_at: None, or the sample at which a number was no longer finite (later entries then mean nothing).
    """

    x: Array
    P: Array
    x_prior: Array
    P_prior: Array
    Phi: Array
    Qd: Array
    H: Array
    K: Array
    innovation: Array
    variance: Array
    seen: npt.NDArray[np.bool_]
    R: Array
    failed_at: int | None = None

    @property
    def log_likelihood(self) -> float:
        """Logarithm of the innovations' density, up to the constant of 2 pi."""
        return -0.5 * float(np.sum(self.innovation**2 / self.variance + np.log(self.variance)))

    def failure(self, t: Array) -> str:
        """What went wrong at `failed_at`, of times t (N,)."""
        assert self.failed_at is not None
        return f"the filter diverged at t = {t[self.failed_at]:.4g} s; its last estimate is held from there"


def filtered(
    model: Model, record: Record, x0: Array, P0: Array, Q: Array, R: Array,
    *, spread: bool = False, around: tuple[Array, Array] | None = None,
) -> Filtered:  # fmt: skip
    """The extended Kalman filter over one run, from x0, P0 at its first sample, which is used too.

    Q (n,) or (n, n): density of the process noise; R (outputs,): variance of a sample; `spread`: the noise acts
    through the step, not at its end; `around`, two (N, n): linearise the outputs and the
    steps there (iterated smoother).
    """
    program, N = model.program, len(record)
    n, m = program.n, program.outputs_count
    density = np.diag(Q) if np.ndim(Q) == 1 else Q
    if (np.shape(x0), np.shape(P0), density.shape) != ((n,), (n, n), (n, n)):
        shapes = f"x0 {np.shape(x0)}, P0 {np.shape(P0)}, Q {np.shape(Q)}"
        raise ValueError(f"expected x0 ({n},), P0 ({n}, {n}) and Q ({n},) or ({n}, {n}) for {n} states, got {shapes}")
    X, Xp = np.zeros((N, n)), np.zeros((N, n))
    P, Pp, Phi, Qd = (np.zeros((N, n, n)) for _ in range(4))
    H, K = np.zeros((N, m, n)), np.zeros((N, m, n))
    nu, s = np.zeros((N, m)), np.ones((N, m))
    work = workspace(n, program.inputs, program.parameters, 0)
    own = ekf_workspace(n, program.parameters, m)
    off = program.all_off()
    failed = ekf(
        program.step_when(off), program.rate, program.output, *arrays(record.t, record.u), model.linear_inputs,
        *arrays(record.y),
        *arrays(*(around or (X, X))), int(around is not None), *arrays(x0, P0), model.values,
        off, *arrays(density), int(spread), *arrays(R), model.angles, np.zeros(0, dtype=np.int64),
        work, own, X, P, Xp, Pp, Phi, Qd, H, K, nu, s,
    )  # fmt: skip
    return Filtered(X, P, Xp, Pp, Phi, Qd, H, K, nu, s, ~np.isnan(record.y), R, None if failed < 0 else int(failed))


def held(values: Array, failed_at: int | None) -> Array:
    """The values with the last finite entry before `failed_at` in place of all that follows (zero if there is none)."""
    if failed_at is None:
        return values
    kept = values.copy()
    kept[failed_at:] = values[failed_at - 1] if failed_at > 0 else 0.0
    return kept


def rates(model: Model, record: Record, X: Array, jumps: Array) -> Array:
    """The constant rates (N, n) that make the jumps (N, n) of a filter with states X (N, n) within its steps."""
    program, D = model.program, np.zeros_like(X)
    rates_from_jumps(
        program.rate, *arrays(record.t, record.u), model.values, program.all_off(), *arrays(X, jumps),
        jump_workspace(program.n, program.parameters), D,
    )  # fmt: skip
    return D
