"""Whether an estimator is on a linear plant what it claims to be, and whether its covariance is right there."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2

from suite.contracts import gaussian, plants
from suite.contracts.outcome import NotApplicableError, demand, estimated
from suite.disturbance import with_integrated_walk, with_random_walk
from suite.estimator import Estimator
from suite.model import Model
from suite.record import Prior, Record

Array = npt.NDArray[np.float64]

SEEDS, SAMPLES, DT = 40, 40, 0.05
MODEL_ERRORS = ("white noise", "random walk", "integrated walk")
RARE = 1e-3  # a right covariance leaves the band this often on either side


def _experiment(model: Model) -> Record:
    """Inputs on a time axis with steps of two lengths; nothing measured yet."""
    t = DT * np.cumsum(np.r_[0.0, np.where(np.arange(SAMPLES - 1) % 3 == 0, 1.5, 1.0)])
    u = np.array([[np.sin(1.5 * time)] * len(model.inputs) for time in t])
    return Record(t, u, np.full((SAMPLES, len(model.outputs)), np.nan))


def _known(estimator: Estimator, model: Model, record: Record, prior: Prior) -> tuple[Model, Prior]:
    """The linear plant for which the estimator says that it is optimal."""
    walks = {"random walk": with_random_walk, "integrated walk": with_integrated_walk}
    if estimator.optimal in walks:
        return walks[estimator.optimal](model, record, prior, 1.0)
    return model, prior


def _measured(path: gaussian.Path, prior: Prior, record: Record, seed: int) -> tuple[Record, Array]:
    """A realisation with gaps that differ by channel, and its states (N, n)."""
    rng = np.random.default_rng(seed)
    x = path.drawn(rng)
    y = x @ path.H.T + np.sqrt(prior.R) * rng.standard_normal(record.y.shape)
    y[rng.random(y.shape) < 0.2] = np.nan
    return Record(record.t, record.u, y, prior=prior), x


def linear_gaussian(estimator: Estimator) -> str:
    """On a linear plant x and P are those of the exact filter or smoother, within the estimator's own claim."""
    if estimator.optimal is None:
        raise NotApplicableError("it claims no optimality (class attribute `optimal`)")
    demand(
        estimator.optimal in MODEL_ERRORS,
        f"optimal = {estimator.optimal!r}, expected one of {', '.join(MODEL_ERRORS)}, or None",
    )
    said = []
    for model in (plants.LINEAR, plants.POSITION):
        n, start, blank = len(model.states), plants.gaussian_prior(model), _experiment(model)
        known, prior = _known(estimator, model, blank, start)
        record, _ = _measured(gaussian.path(known, blank, prior, "exact"), start, blank, 1)
        found = estimated(estimator, model, record)
        demand(found.status == "ok", f"it ended {found.status!r} on a stable linear plant: {found.note}")
        gaps = {}
        for form in gaussian.FORMS:
            x, P = gaussian.path(known, blank, prior, form).given(record.y, start.R, causal=estimator.kind == "filter")
            sd = np.sqrt(np.diagonal(P, axis1=1, axis2=2))[:, :n]
            gap = float(np.max(np.abs(found.x - x[:, :n]) / sd))
            if found.P is not None:
                size = sd[:, :, None] * sd[:, None, :]
                gap = max(gap, float(np.max(np.abs(found.P - P[:, :n, :n]) / size)))
            gaps[form] = gap
        nearest = min(gaps, key=lambda form: gaps[form])
        demand(
            gaps[nearest] <= estimator.optimal_within,
            f"with {len(model.outputs)} output(s) it is {gaps[nearest]:.2g} posterior standard deviations from the "
            f"exact {estimator.kind} for {estimator.optimal}; it claims {estimator.optimal_within:g}",
        )
        said.append(f"{gaps[nearest]:.1e} sd (noise {nearest})")
    return f"from the exact {estimator.kind}: {', '.join(said)}"


def calibrated(estimator: Estimator) -> str:
    """Over seeds the normalised squared error lies in its chi-square band, on the plant of the claim."""
    model = plants.LINEAR
    start, blank = plants.gaussian_prior(model), _experiment(model)
    known, prior = _known(estimator, model, blank, start)
    path, total, n = gaussian.path(known, blank, prior, "exact"), 0.0, len(model.states)
    # One sample of each run, so that the terms are independent: the last of a filter, the middle of a smoother.
    k = SAMPLES - 1 if estimator.kind == "filter" else SAMPLES // 2
    for seed in range(SEEDS):
        record, x = _measured(path, start, blank, 100 + seed)
        found = estimated(estimator, model, record)
        if found.P is None:
            raise NotApplicableError("it returns no covariance")
        error = found.x[k] - x[k, :n]
        total += float(error @ np.linalg.pinv(found.P[k], hermitian=True) @ error)
    low, high = (float(chi2.ppf(p, SEEDS * n)) / (SEEDS * n) for p in (RARE, 1.0 - RARE))
    ratio = total / (SEEDS * n)
    said = f"NEES {ratio:.2f} of 1 over {SEEDS} seeds, band {low:.2f} to {high:.2f}"
    if estimator.optimal is None:
        raise NotApplicableError(f"it claims no model error for which P is calibrated; for white noise: {said}")
    demand(low <= ratio <= high, said)
    return said
