"""How much a filter amplifies what it is not told: H-infinity norms, and the conditions of a robust estimate.

The error system of a filter along a run takes the first error, the model error d and the sensors' noise to the error of
the outputs. All are measured in the cost's own units, so that the norm has none:

    in:   P0^-1/2 e(0),  Q^1/2 d sqrt(dt),  R^-1/2 v      (R the variance of a sample, Q the weight of d in J)
    out:  R^-1/2 H e at every sample

Its norm is the largest ratio of the energies' roots over the run (Green and Limebeer 1995, chapter 3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dtbtrs
from scipy.sparse.linalg import LinearOperator, svds

Array = npt.NDArray[np.float64]

# Above so many numbers in the error system its norm is not computed: it would cost more than the run.
LARGEST = 2_000_000


def norm(F: Array, G: Array, C: Array, slowest: float = 0.0) -> float:
    """The H-infinity norm of C (sI - F)^-1 G, by the two-step algorithm (Bruinsma and Steinbuch 1990).

    F (n, n), G (n, m), C (outputs, n). Where F is not stable the norm is infinite, and with `slowest` (rad/s) the
    largest gain at frequencies above it is given instead.
    """
    if not G.size or not C.size:
        return 0.0
    n = len(F)

    def gain(w: float) -> float:
        return float(np.linalg.norm(C @ np.linalg.solve(1j * w * np.eye(n) - F, G.astype(complex)), 2))

    eigenvalues = np.linalg.eigvals(F)
    pace = float(np.max(np.abs(eigenvalues))) + 1e-12
    if np.max(eigenvalues.real) >= -1e-9 * pace:
        if slowest <= 0.0:
            return float("inf")
        return max(gain(float(w)) for w in np.geomspace(slowest, max(1e3 * pace, 1e3 * slowest), 400))
    low = max(gain(float(w)) for w in [0.0, *np.abs(eigenvalues)])
    for _ in range(50):
        gamma = low * (1.0 + 2e-10)
        if gamma == 0.0:
            return 0.0
        # Frequencies with this gain: imaginary eigenvalues of the Hamiltonian, whose blocks are kept of one size.
        found = np.linalg.eigvals(np.block([[F, G @ G.T / gamma], [-C.T @ C / gamma, -F.T]]))
        crossed = np.sort(np.abs(found.imag[np.abs(found.real) < 1e-8 * np.max(np.abs(found))]))
        middles = 0.5 * (crossed[1:] + crossed[:-1])
        higher = max([low, *(gain(float(w)) for w in middles)])
        if higher <= gamma:
            return low
        low = higher
    return low


@dataclass(frozen=True)
class ErrorSystem:
    """A filter's linear error system over N samples.

    e(0) = A[0] e_first - K[0] v(0),  e(k) = A[k] e(k-1) + B[k] d(k) - K[k] v(k),  out C[k] e(k).
    A (N, n, n), B (N, n, sources), K (N, n, outputs), C (N, outputs, n), all in the units of the module's docstring.
    """

    A: Array
    B: Array
    K: Array
    C: Array

    def induced(self) -> float:
        """The largest ratio of the roots of energies, out over in; NaN where it is not found."""
        N, n, _ = self.A.shape
        sources, channels = self.B.shape[2], self.K.shape[2]
        cut = np.cumsum([n, (N - 1) * sources])
        # The unit lower triangle of e(k) - A[k] e(k-1), as LAPACK wants a band: element i, j in row i - j.
        band = np.zeros((2 * n, N * n))
        for i in range(n):
            for j in range(n):
                band[n + i - j, j : (N - 1) * n : n] = -self.A[1:, i, j]

        def forward(w: Array) -> Array:
            first, d, v = np.split(w.ravel(), cut)
            drive = -np.einsum("kij,kj->ki", self.K, v.reshape(N, channels))
            drive[0] += self.A[0] @ first
            drive[1:] += np.einsum("kij,kj->ki", self.B[1:], d.reshape(N - 1, sources))
            e = dtbtrs(band, drive.ravel(), uplo="L", trans="N", diag="U")[0]
            out: Array = np.einsum("kij,kj->ki", self.C, e.reshape(N, n)).ravel()
            return out

        def back(z: Array) -> Array:
            pull = np.einsum("kij,ki->kj", self.C, z.reshape(N, channels))
            a = dtbtrs(band, pull.ravel(), uplo="L", trans="T", diag="U")[0].reshape(N, n)
            d, v = np.einsum("kij,ki->kj", self.B[1:], a[1:]), -np.einsum("kij,ki->kj", self.K, a)
            return np.concatenate([self.A[0].T @ a[0], d.ravel(), v.ravel()])

        shape = (N * channels, int(cut[-1]) + N * channels)
        operator = LinearOperator(shape, matvec=forward, rmatvec=back, dtype=np.float64)
        try:
            # A singular value is known to the square of the vector's tolerance: to 1e-3 at least, whatever the length.
            found = svds(operator, k=1, return_singular_vectors=False, v0=np.ones(min(shape)), tol=0.03)
        except (ArithmeticError, RuntimeError, ValueError):
            return float("nan")
        return float(found[0])

    @property
    def contracts(self) -> bool:
        """Whether an error fades with time, the system held as it is at the last sample."""
        return bool(np.max(np.abs(np.linalg.eigvals(self.A[-1]))) < 1.0)


def error_system(
    Phi: Array, H: Array, gains: Array, R: Array, inverse: Array, P0: Array, dt: Array
) -> ErrorSystem:  # fmt: skip
    """The error system of the gains (N, n, outputs) of a filter, in the units of the cost.

    Phi (N, n, n): transition into a sample; H (N, outputs, n); R (outputs,) the variance of a sample; inverse (n, n):
    Q^-1, zero for definitions; P0 (n, n); dt (N - 1,). d is constant over a step and acts through it, to second order.
    """
    n, sd = len(inverse), np.sqrt(R)
    kept = np.eye(n) - gains @ H
    held = 0.5 * dt[:, None, None] * (np.eye(n) + Phi[1:])
    counted = np.diag(inverse) > 0.0
    root = _root(inverse)[:, counted] if np.array_equal(inverse, np.diag(np.diag(inverse))) else _root(inverse)
    A, B = kept @ Phi, np.zeros((len(Phi), n, root.shape[1]))
    A[0] = kept[0] @ _root(P0)
    B[1:] = kept[1:] @ (held @ root) / np.sqrt(dt)[:, None, None]
    return ErrorSystem(A, B, gains * sd, H / sd[:, None])


def _root(P: Array) -> Array:
    """The symmetric root of a matrix that is not negative."""
    values, vectors = np.linalg.eigh(P)
    root: Array = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return root


def conditions(
    system: ErrorSystem | None, definite: bool, J: tuple[float, float] | None, alpha: float
) -> dict[str, float | str]:
    """The norm and the four conditions of a robust estimate, as numbers that are finite, or words.

    (i) the error system is stable; (ii) S >= 0 over the run; (iii) its norm is below gamma, where alpha = -gamma^2;
    (iv) the energy of the residuals R^-1/2 (z - h) over that of the model error Q^1/2 d is below gamma^2: J < 0.
    `system`: None for a run that has none in finite numbers.
    """
    gamma = np.sqrt(-alpha) if alpha < 0.0 else None
    if system is None:
        found: float | str = "none: the filter left every bound"
    elif system.A.size * 2 > LARGEST:
        found = "not computed: the record is too long"
    else:
        value = system.induced()
        found = value if np.isfinite(value) else "not found"
    unasked = "no gamma (alpha > 0)"
    below: str = unasked
    if gamma is not None:
        below = found if isinstance(found, str) else ("yes" if found < gamma else "no")
    ratio: float | str = "none"
    if J is not None and J[1] != 0.0:
        value = J[0] / (J[1] / alpha)
        ratio = value if np.isfinite(value) else "none"
    energy = unasked if gamma is None else ("no" if isinstance(ratio, str) or ratio >= gamma**2 else "yes")
    return {
        "H-infinity norm": found,
        "residual over model-error energy": ratio,
        "(i) error system stable": "none" if system is None else ("yes" if system.contracts else "no"),
        "(ii) S >= 0": "yes" if definite else "no",
        "(iii) norm < gamma": below,
        "(iv) energy ratio < gamma^2": energy,
    }
