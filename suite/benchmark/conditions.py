"""The conditions of the recovery benchmark: what plant is run, what the file says, and how the sensors misbehave.

Each gives a Trial: what a method gets (model, record, library) beside what the judge alone sees. Start values of the
model are drawn about the true ones by their stated sd, since a file is never exactly right; `fixed` values are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from suite.benchmark import columns
from suite.case import Case, Missing
from suite.effect import Effect
from suite.errors import DataError
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]

NULLS = ("null-right", "null-wrong")
SPOILED = ("coloured", "outliers", "wrong-sigma")
CONDITIONS = ("missing", *NULLS, "outside", *SPOILED)

UNSTATED = 0.3  # null-wrong: log-sd of a start value whose sd the file leaves open
AR1 = 0.7  # coloured: correlation of neighbouring errors
SHARE, AWAY = 0.02, 10.0  # outliers: how many, how many sigma away
WRONG = 3.0  # wrong-sigma: the file's sigma over the sensor's, or its inverse for odd seeds


@dataclass(frozen=True)
class Trial:
    """One experiment: `model`, `record` and `effects` go to the method; clean (N, outputs) is the true output, sigma
    (outputs,) the sensors' standard deviation, `missing` what is truly missing (nothing: a null), `known` whether the
    library holds it.
    """

    model: Model
    record: Record
    effects: Mapping[str, Effect]
    clean: Array
    sigma: Array
    missing: tuple[Missing, ...]
    known: bool = True

    @property
    def library(self) -> dict[str, Effect]:
        """The effects that are searched: those of the library and the model's own, by id."""
        return {effect.id: effect for effect in self.model.effects} | dict(self.effects)

    @property
    def truth(self) -> frozenset[tuple[str, str]]:
        """What is missing, as (effect, equation)."""
        return frozenset((entry.effect, entry.equation) for entry in self.missing)


def inapplicable(case: Case, condition: str, effects: Mapping[str, Effect]) -> str | None:
    """Why a case has no such condition, or None."""
    if case.truth is None or case.held:
        return "it is measured, or its model error is held over each sample"
    if condition in NULLS:
        return None
    if not case.missing:
        return "nothing is missing in it"
    held = {*effects, *(effect.id for effect in case.deficient.effects)}
    if condition != "outside" and not {entry.effect for entry in case.missing} <= held:
        return "the library does not hold what is missing in it"
    return None


def trial(case: Case, condition: str, noise: float, seed: int, effects: Mapping[str, Effect]) -> Trial:
    """The experiment of a cell; DataError where this plant cannot be run so."""
    if condition in NULLS:
        case = _complete(case)
    (record, truth), (still, _) = case.simulate(noise, seed), case.simulate(0.0, seed)
    clean, sigma = still.y, truth.noise
    finite = np.isfinite(truth.x).all() and np.isfinite(sigma).all()
    if not (finite and (sigma > 0).all()):
        said = "has no noise or stands still" if finite else "runs away"
        raise DataError(f"{case.name}: the plant of {condition!r} {said}, so there is nothing to judge")
    rng = np.random.default_rng([seed, 1])
    model = case.deficient if condition == "null-right" else _drawn(case.deficient, rng, condition == "null-wrong")
    if condition in SPOILED:
        model, record = _spoiled(condition, model, record, clean, sigma, seed)
    known = condition != "outside"
    if not known:
        gone = {entry.effect for entry in case.missing}
        # A shape with a power of its own is any of them.
        gone |= {name for name, effect in effects.items() if effect.generic and effect.inner}
        gone |= columns.look_alikes(case.deficient, effects, case.missing, record, truth.x)
        effects = {name: effect for name, effect in effects.items() if name not in gone}
        model = replace(model, effects=tuple(effect for effect in model.effects if effect.id not in gone))
    return Trial(model, record, effects, clean, sigma, case.missing, known)


def _complete(case: Case) -> Case:
    """The case with its deficient model as the plant: nothing is missing."""
    assert case.truth is not None
    assert case.experiment is not None
    first = dict(zip(case.truth.states, case.experiment.x0, strict=True))
    experiment = replace(case.experiment, x0=tuple(first[name] for name in case.deficient.states))
    return replace(case, truth=case.deficient, experiment=experiment, missing=())


def _drawn(model: Model, rng: np.random.Generator, all_wrong: bool) -> Model:
    """The model with start values value + sd * normal within bounds; `all_wrong`: also those without a stated sd."""
    values = {}
    for name, parameter in model.parameters.items():
        z = float(rng.standard_normal())
        if parameter.fixed:
            continue
        if parameter.sd is not None:
            values[name] = float(np.clip(parameter.value + parameter.sd * z, *parameter.bounds))
        elif all_wrong:
            values[name] = float(np.clip(parameter.value * np.exp(UNSTATED * z), *parameter.bounds))
    return model.with_values(values)


def _spoiled(
    condition: str, model: Model, record: Record, clean: Array, sigma: Array, seed: int
) -> tuple[Model, Record]:
    """The model and record with what method and file do not know: coloured noise, outliers, a wrong sigma."""
    rng = np.random.default_rng([seed, 2])
    if condition == "coloured":
        white = rng.standard_normal((len(clean) + 50, clean.shape[1]))
        error = np.sqrt(1.0 - AR1**2) * lfilter([1.0], [1.0, -AR1], white, axis=0)[50:]
        return model, replace(record, y=clean + sigma * error)
    if condition == "outliers":
        struck = rng.random(clean.shape) < SHARE
        side = rng.choice([-1.0, 1.0], clean.shape)
        return model, replace(record, y=np.where(struck, clean + AWAY * sigma * side, record.y))
    factor = WRONG if seed % 2 == 0 else 1.0 / WRONG
    outputs = {
        name: replace(output, sigma=float(factor * s))
        for (name, output), s in zip(model.outputs.items(), sigma, strict=True)
    }
    return replace(model, outputs=outputs), record
