"""All that a watched sample asks for, in one compiled call: three filters, their tests, and the numbers to show."""

from __future__ import annotations

import math
from typing import Any

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.streaming import LOST, OUTPUTS, STATES, next_sample

# Entries of a cumulative sum: its limit, the sum, since when it is above zero, since when it has been at its limit.
LIMIT, SUM, STARTED, SINCE = range(4)
# Entries of the least squares: how long the past counts, the share of an innovation in the misfit, the last time, the
# misfit; the largest variances (n), the first x (n) and the first P (n n) follow.
MEMORY, SHARE, LAST, MISFIT, MOST = range(5)
# Innovations whose sd grew by GROWTH are what the sum looks for; beyond CLIP sd one counts as that: an outlier is no
# failing model.
GROWTH, CLIP = 1.5, 3.0
A, B = 0.5 * (1.0 - GROWTH**-2), math.log(GROWTH)
SPREAD = 10.0  # a state that nothing measures is not known better than its size, and not worse than so many times that


@compile_kernel(nb.types.void(nb.VECTOR, nb.REAL, nb.VECTOR))
def cusum(test: Any, t: float, e: Any) -> None:
    """Add the innovations e (channels,) of a sample over their sd; NaN was not measured. Writes test."""
    for c in range(e.shape[0]):
        if math.isnan(e[c]):
            continue
        g = min(test[SUM] + A * min(e[c] * e[c], CLIP**2) - B, test[LIMIT])
        if g <= 0.0:
            test[SUM] = 0.0
            test[STARTED] = math.nan
            test[SINCE] = math.nan
            continue
        test[SUM] = g
        if math.isnan(test[STARTED]):
            test[STARTED] = t
        if g >= test[LIMIT]:
            test[SINCE] = test[STARTED]


@compile_kernel(nb.types.void(nb.REAL, nb.VECTOR, nb.INT, nb.VECTOR, nb.MATRIX))
def forget(grow: float, most: Any, states: int, x: Any, C: Any) -> None:
    """C of x (n,) times `grow`, each variance up to `most` (n,) and never less than it was. Writes C and most.

    `most` of the first `states` is raised to SPREAD^2 times their square.
    """
    n = x.shape[0]
    for i in range(n):
        if i < states:
            most[i] = max(most[i], (SPREAD * x[i]) ** 2)
        factor = min(grow, max(1.0, most[i] / C[i, i])) if C[i, i] > 0.0 else 1.0
        root = math.sqrt(factor)
        # Once by its row and once by its column: the variance by the factor itself.
        for j in range(n):
            C[i, j] *= root
        for j in range(n):
            C[j, i] *= root


@compile_kernel(nb.types.void(nb.INT, nb.VECTOR, nb.VECTOR, nb.INT, nb.REAL, nb.VECTOR))
def age(n: int, real: Any, fit: Any, states: int, t: float, y: Any) -> None:
    """Let the least squares of n states forget before a sample that brings a measurement. Writes real and fit."""
    measured = False
    for c in range(y.shape[0]):
        measured = measured or not math.isnan(y[c])
    if measured and t > fit[LAST]:
        grow = math.exp((t - fit[LAST]) / fit[MEMORY])
        forget(grow, fit[MOST : MOST + n], states, real[0:n], real[n : n + n * n].reshape((n, n)))
    fit[LAST] = t


@compile_kernel(nb.types.void(nb.VECTOR, nb.VECTOR))
def learn(fit: Any, e: Any) -> None:
    """Reckon the misfit with the innovations e (outputs,) of a sample over their sd. Writes fit."""
    for c in range(e.shape[0]):
        if math.isfinite(e[c]):
            fit[MISFIT] += fit[SHARE] * (e[c] * e[c] - fit[MISFIT])


@compile_kernel(nb.types.void(nb.INT, nb.VECTOR, nb.VECTOR, nb.INT, nb.INT, nb.VECTOR))
def restart(n: int, real: Any, fit: Any, states: int, other: int, better: Any) -> None:
    """Know of the parameters what was known at first, of the model's states what another filter does.

    n: states of the filter, whose `real` is written, and fit; other, better: those of the other filter, which opens
    with the same `states`.
    """
    for i in range(n + n * n):
        real[i] = fit[MOST + n + i]
    for i in range(states):
        real[i] = better[i]
        for j in range(states):
            real[n + i * n + j] = better[other + i * other + j]
    fit[MISFIT] = 1.0


@compile_kernel(
    nb.types.void(
        nb.REAL, nb.VECTOR, nb.VECTOR, nb.INT, nb.INT, nb.INT, nb.INT, nb.INDICES, nb.VECTOR, nb.INDICES, nb.VECTOR,
        nb.INDICES, nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.VECTOR,
    )
)  # fmt: skip
def watched(
    t: float, u: Any, y: Any, quiet: int, states: int, suspects: int, coefficients: int,
    null_whole: Any, null: Any, error_whole: Any, error: Any, effect_whole: Any, effect: Any, fit: Any,
    alarm: Any, fits: Any, out: Any,
) -> None:  # fmt: skip
    """Take a sample: the model's own filter, the one with d, the one with the effect, and the tests unless `quiet`.

    u (inputs,), y (outputs,), NaN where missing; states of the model; suspects: states of `error` after those, its d;
    coefficients: the last states of `effect`, none where there is no effect. Writes all that follow. out: the
    innovations (outputs), d and its sd (suspects each), the coefficients and their sd (coefficients each), the
    statistic, since when the model has failed (NaN: it has not), 1 where a filter was lost.
    """
    if coefficients > 0:
        age(effect_whole[STATES], effect, fit, states, t, y)
    # One place that calls, for what is called is compiled into every place.
    for i in range(3 if coefficients > 0 else 2):
        whole = null_whole if i == 0 else (error_whole if i == 1 else effect_whole)
        real = null if i == 0 else (error if i == 1 else effect)
        next_sample(whole, real, t, u, y)
    outputs = null_whole[OUTPUTS]
    n = null_whole[STATES]
    e = null[n + n * n : n + n * n + outputs]
    if quiet == 0:
        cusum(alarm, t, e)
    lost = null_whole[LOST] + error_whole[LOST]
    for c in range(outputs):
        out[c] = e[c]
    at = outputs
    n = error_whole[STATES]
    for j in range(suspects):
        i = states + j
        out[at + j] = error[i]
        # A variance below zero by rounding is zero.
        out[at + suspects + j] = math.sqrt(max(error[n + i * n + i], 0.0))
    at += 2 * suspects
    if coefficients > 0:
        m = effect_whole[STATES]
        e = effect[m + m * m : m + m * m + outputs]
        learn(fit, e)
        if quiet == 0:
            cusum(fits, t, e)
            if not math.isnan(fits[SINCE]):
                # What was learnt is of the plant before; the filter with d knows where the plant is.
                restart(m, effect, fit, states, n, error)
                fits[SUM] = 0.0
                fits[STARTED] = math.nan
                fits[SINCE] = math.nan
        lost += effect_whole[LOST]
        for j in range(coefficients):
            i = m - coefficients + j
            out[at + j] = effect[i]
            # The band grows by what the effect leaves unexplained, as in least squares.
            out[at + coefficients + j] = math.sqrt(max(effect[m + i * m + i], 0.0) * max(1.0, fit[MISFIT]))
        at += 2 * coefficients
    out[at] = alarm[SUM] / alarm[LIMIT]
    out[at + 1] = alarm[SINCE]
    out[at + 2] = 1.0 if lost > 0 else 0.0
