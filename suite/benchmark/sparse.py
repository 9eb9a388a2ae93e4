"""Sparse regression on the discrepancy with PySINDy: STLSQ, its ensemble, and the weak form.

d = (derivative of the measured states) - (rate of the calibrated model), regressed on the same candidates that the
other methods get. Columns are scaled to one; the threshold is the one of least BIC of a grid, an empty model included.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.benchmark import columns
from suite.benchmark.columns import Name
from suite.benchmark.conditions import Trial
from suite.benchmark.rivals import Answer, calibrated, independent
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]
Solver = Callable[[Array, Array, float], Array]

THRESHOLDS = np.geomspace(0.01, 1.0, 15)  # of a coefficient on columns and d of size one
MODELS = 20  # of the ensemble
INCLUDED = 0.6  # share of the ensemble that must take a term (Fasel and others 2022)
DOMAINS = 200  # test functions of the weak form, each over a tenth of the record
APART = 40  # of them that count as independent: they overlap


def skip(trial: Trial) -> str | None:
    """Why PySINDy cannot be asked, or None."""
    measured = {output.equation.strip() for output in trial.model.outputs.values()}
    unseen = [name for name in trial.model.states if name not in measured]
    if unseen:
        return f"it needs every state measured; {', '.join(unseen)} is not"
    if np.isnan(trial.record.y).any() or len(trial.record.starts) > 1 or np.ptp(trial.record.dt) > 1e-6:
        return "it needs one run of evenly sampled data without gaps"
    if find_spec("pysindy") is None:
        return "PySINDy is not installed; install the extra: pip install 'unmodelled[peers]'"
    return None


def stlsq(trial: Trial) -> Answer:
    """Sequentially thresholded least squares on the differentiated data (Brunton and others 2016)."""
    return _pointwise(trial, _thresholded)


def ensemble(trial: Trial) -> Answer:
    """The same bagged: what most of the models take (Fasel and others 2022)."""
    return _pointwise(trial, _bagged)


def weak(trial: Trial) -> Answer:
    """The weak form: rate and candidates are integrated against test functions (Messenger and Bortz 2021)."""
    import pysindy

    model, record, x = _states(trial)
    library_columns = columns.named(model, trial.effects, record, x)
    # Every feature is a function of the states, its values looked up beside them: the record is one fixed path.
    rates = np.array([model.rate(t, state, u) for t, state, u in zip(record.t, x, record.u, strict=True)])
    found: list[tuple[float, Name]] = []
    for i, equation in enumerate(model.states):
        group = {name: column for name, column in library_columns.items() if name[1] == equation}
        if equation not in model.suspects or not group:
            continue
        data = np.column_stack([x[:, i], rates[:, i], *group.values()])
        # The test functions are placed at random, by the global state that this library uses.
        state = np.random.get_state()
        np.random.seed(0)
        try:
            library = pysindy.WeakPDELibrary(
                function_library=pysindy.IdentityLibrary(), spatiotemporal_grid=record.t, K=DOMAINS, include_bias=False
            )
            features = pysindy.AxesArray(data, {"ax_time": 0, "ax_coord": 1})
            library.fit(features)
            integrated = np.asarray(library.transform(features))
            slopes = np.asarray(library.convert_u_dot_integral(features))[:, 0]
        finally:
            np.random.set_state(state)
        found += _sizes(group, integrated[:, 2:], slopes - integrated[:, 1], _thresholded, APART)
    return _answer(found, columns.disguised(model, record, x, library_columns))


def _pointwise(trial: Trial, solve: Solver) -> Answer:
    import pysindy

    model, record, x = _states(trial)
    library_columns = columns.named(model, trial.effects, record, x)
    slopes = np.asarray(pysindy.SmoothedFiniteDifference()(x, record.t))  # pyright: ignore[reportArgumentType]
    rates = np.array([model.rate(t, state, u) for t, state, u in zip(record.t, x, record.u, strict=True)])
    found: list[tuple[float, Name]] = []
    for i, equation in enumerate(model.states):
        group = {name: column for name, column in library_columns.items() if name[1] == equation}
        if equation in model.suspects and group:
            A, d = np.column_stack(list(group.values())), slopes[:, i] - rates[:, i]
            found += _sizes(group, A, d, solve, independent(d, A))
    return _answer(found, columns.disguised(model, record, x, library_columns))


def _states(trial: Trial) -> tuple[Model, Record, Array]:
    """The deficient model refitted, the record, and the states as they were measured, (N, n)."""
    model, record = calibrated(trial)
    names = [output.equation.strip() for output in model.outputs.values()]
    x = record.y[:, [names.index(state) for state in model.states]]
    return model, record, np.ascontiguousarray(x)


def _sizes(group: dict[Name, Array], A: Array, d: Array, solve: Solver, count: float) -> list[tuple[float, Name]]:
    """Each term's share of d, its coefficient on columns of size one; 0 where it is not taken."""
    scale = np.maximum(np.sqrt(np.mean(A**2, axis=0)), 1e-300)
    size = float(np.sqrt(np.mean(d**2)))
    if size == 0.0:
        return [(0.0, name) for name in group]
    c = solve(A / scale, d / size, count)
    return [(abs(float(value)), name) for value, name in zip(c, group, strict=True)]


def _answer(found: list[tuple[float, Name]], disguised: set[Name]) -> Answer:
    """What was taken, largest share first; a parameter in disguise corrects the calibration and is no effect."""
    ranked = sorted((pair for pair in found if pair[1] not in disguised), key=lambda pair: -pair[0])
    named = tuple(name for size, name in ranked if size > 0)
    return Answer(named, tuple(name for _, name in ranked), len(found))


def _thresholded(A: Array, d: Array, count: float) -> Array:
    """The coefficients of least BIC over the thresholds, `count` independent samples."""
    return _chosen(A, d, count)[0]


def _chosen(A: Array, d: Array, count: float) -> tuple[Array, float]:
    """The coefficients of least BIC and their threshold; nothing and the largest one where no model pays."""
    best, at = np.zeros(A.shape[1]), float(THRESHOLDS[-1])
    lowest = count * np.log(float(np.mean(d**2)))
    for threshold in THRESHOLDS:
        c = np.ravel(_optimizer(threshold).fit(A, d[:, None]).coef_)
        cost = count * np.log(max(float(np.mean((d - A @ c) ** 2)), 1e-300)) + np.count_nonzero(c) * np.log(count)
        if c.any() and cost < lowest:
            best, at, lowest = c, float(threshold), cost
    return best, at


def _bagged(A: Array, d: Array, count: float) -> Array:
    """The median of the models, a term that fewer than INCLUDED of them take left out."""
    import pysindy

    _, threshold = _chosen(A, d, count)
    state = np.random.get_state()
    np.random.seed(0)
    try:
        bag = pysindy.EnsembleOptimizer(_optimizer(threshold), bagging=True, n_models=MODELS)
        bag.fit(A, d[:, None])
    finally:
        np.random.set_state(state)
    every = np.array([np.ravel(c) for c in bag.coef_list])
    return np.where((every != 0).mean(axis=0) >= INCLUDED, np.median(every, axis=0), 0.0)


def _optimizer(threshold: float) -> Any:
    import pysindy

    return pysindy.STLSQ(threshold=float(threshold), alpha=1e-6)
