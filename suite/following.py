"""Parameters that are followed while a filter runs: states that are constant by themselves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from suite.model import Initial, Model
from suite.record import Prior


def follow(model: Model, prior: Prior, parameters: Mapping[str, float]) -> tuple[Model, Prior]:
    """The model with the parameters as its last states, in their order, and the prior for all.

    `parameters`: how well each is known at first, its sd; `prior` is for the model's own states.
    """
    kept = {name: parameter for name, parameter in model.parameters.items() if name not in parameters}
    values = {name: model.parameters[name].value for name in parameters}
    grown = replace(
        model,
        states={**model.states, **dict.fromkeys(parameters, "0")},
        parameters=kept,
        initial={**model.initial, **{name: Initial(value, estimate=True) for name, value in values.items()}},
        suspect=model.suspects,
    )
    n, m = len(model.states), len(parameters)
    P0 = np.zeros((n + m, n + m))
    P0[:n, :n] = prior.P0
    P0[n:, n:] = np.diag([sd**2 for sd in parameters.values()])
    x0 = np.concatenate([prior.x0, np.array(list(values.values()))])
    return grown, Prior(x0, P0, prior.R, np.concatenate([prior.Q, np.zeros(m)]))


def uncertain(model: Model) -> dict[str, float]:
    """The model's own parameters that are not exact, each with how well the file says it is known, its sd.

    Where nothing is known (`free`) their own size is the sd; a parameter of value 0 that is free has none and stays.
    A delay stays too: it is no number of an equation.
    """
    delays = {entry.delay for entry in model.inputs.values()}
    found = {}
    for name, parameter in model.parameters.items():
        sd = parameter.prior_sd if np.isfinite(parameter.prior_sd) else abs(parameter.value)
        if sd > 0.0 and name not in delays:
            found[name] = sd
    return found
