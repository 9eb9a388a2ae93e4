"""What every case must hold: it repeats itself, and what it says is missing is what is missing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from suite import plugins, units
from suite.benchmark.cells import experiment
from suite.case import Case, Missing, Truth
from suite.contracts.outcome import NotApplicableError, demand
from suite.discovery.growing import grown
from suite.discovery.library import candidates
from suite.errors import DataError, ModelError
from suite.model import Model, Parameter
from suite.model_file import from_toml, to_toml
from suite.record import Record

NOISE, SEED = 0.05, 7
ALIGNED = 0.99  # |cosine| between d and the library's term of the effect that is said to be missing


def sentence(case: Case) -> str:
    """One sentence, and either a truth with its experiment or a measured record."""
    demand(case.sentence.rstrip().endswith("."), f"the sentence {case.sentence!r} does not end as one")
    demand(bool(case.noises) and min(case.noises) >= 0, f"noises = {case.noises}, expected fractions from 0")
    simulated = case.truth is not None and case.experiment is not None
    demand(simulated != (case.measured is not None), "a case has a truth and an experiment, or a measured record")
    return "simulated" if simulated else "measured"


def records(case: Case) -> str:
    """The record has the model's columns, with a prior; the truth its states."""
    try:
        record, truth = experiment(case, NOISE if case.truth is not None else 0.0, SEED, None)
    except DataError as error:
        raise NotApplicableError(f"the data are not here: {error}") from None
    model, N = case.deficient, len(record)
    demand(record.y.shape == (N, len(model.outputs)), f"y is {record.y.shape} for {len(model.outputs)} outputs")
    demand(record.u.shape == (N, len(model.inputs)), f"u is {record.u.shape} for {len(model.inputs)} inputs")
    demand(bool(np.any(np.isfinite(record.y), axis=0).all()), "an output is never measured")
    if truth is not None:
        n = len(model.states)
        for name, value, shape in (("x", truth.x, (N, n)), ("d", truth.d, (N, n))):
            demand(value.shape == shape, f"the truth's {name} is {value.shape}, expected {shape}")
            demand(bool(np.all(np.isfinite(value))), f"the truth's {name} is not finite: the plant runs away")
    return f"{N} samples"


def seeds(case: Case) -> str:
    """The same seed gives the same record; another seed gives other noise on the same truth."""
    first, truth = _simulated(case, NOISE, SEED)
    again, _ = case.simulate(NOISE, SEED)
    other, same = case.simulate(NOISE, SEED + 1)
    demand(np.array_equal(first.y, again.y, equal_nan=True), "the same seed gives another record")
    demand(np.array_equal(truth.x, same.x), "another seed gives another truth; only the noise may depend on it")
    demand(not np.array_equal(first.y, other.y, equal_nan=True), "another seed gives the same noise")
    return ""


def file(case: Case) -> str:
    """The deficient model written to a file and read again is the same."""
    again = from_toml(to_toml(case.deficient), "model.toml")
    demand(replace(again, source=case.deficient.source) == case.deficient, "its model file reads back as another model")
    return ""


def consistent_units(case: Case) -> str:
    """Where the models have units, the equations agree with them."""
    models = [model for model in (case.deficient, case.truth) if model is not None]
    stated = any(model.units or any(p.unit for p in model.parameters.values()) for model in models)
    if not stated:
        raise NotApplicableError("its models state no units")
    for model in models:
        try:
            units.check(model)
        except ModelError as error:
            demand(False, str(error))
    return ""


def missing(case: Case) -> str:
    """Each missing effect is in the library and in a place of the model; its coefficients are the truth's."""
    if not case.missing:
        raise NotApplicableError("nothing is said to be missing")
    model, truth = case.deficient, case.truth
    places = {*model.states, *model.outputs, *model.inputs, *model.parameters, "t"}
    for entry in case.missing:
        demand(entry.effect in plugins.effects(), f"no effect {entry.effect!r}; `unmodelled list` names them")
        demand(entry.equation in places, f"no state, output, input or parameter {entry.equation!r} in the model")
        for name, value in entry.coefficients.items():
            known = truth.parameters[name].value if truth is not None and name in truth.parameters else value
            demand(known == value, f"{name} = {value:g} is stated, the truth has {known:g}")
    return ", ".join(f"{entry.effect} in {entry.equation}" for entry in case.missing)


def model_error(case: Case) -> str:
    """The truth without its missing terms is the deficient model: their coefficients at zero leave d = 0."""
    entries = _in_rates(case)
    assert case.truth is not None
    record, truth = _simulated(case, 0.0, 0)
    hit = {entry.equation for entry in entries}
    for i, state in enumerate(case.deficient.states):
        acting = bool(np.any(truth.d[:, i]))
        demand(acting == (state in hit), f"d {'acts' if acting else 'does not act'} in {state}; missing says otherwise")
    gone = {name: 0.0 for entry in entries for name in entry.coefficients}
    demand(set(gone) <= set(case.truth.parameters), f"the truth has no parameter {', '.join(gone)}")
    left = _gap(case, case.truth.with_values(gone), record, truth)
    size = float(np.max(np.abs(truth.d)))
    if left > 1e-9 * size:
        raise NotApplicableError(
            f"with {', '.join(gone)} at zero {left:.2g} of d = {size:.2g} is left: the effect is not linear in them"
        )
    return f"largest {size:.3g}"


def shape(case: Case) -> str:
    """d is the library's term of the effect, at the true states."""
    entries = _in_rates(case)
    record, truth = _simulated(case, 0.0, 0)
    said = []
    for entry in entries:
        if sum(other.equation == entry.equation for other in entries) > 1:
            raise NotApplicableError(f"several effects are missing in {entry.equation}")
        effect = plugins.effects()[entry.effect]
        if effect.inner or effect.states:
            raise NotApplicableError(f"{effect.id} has inner scales or states of its own")
        i = list(case.deficient.states).index(entry.equation)
        cosines = []
        terms = candidates(case.deficient, {effect.id: effect}, absolute=True)
        for term in (term for term in terms if term.equation == entry.equation):
            one = {name: Parameter(1.0) for name in term.names}
            with_it = grown(case.deficient, [term], [one])
            added = np.array([
                with_it.rate(t, x, tuple(u))[i] - case.deficient.rate(t, x, tuple(u))[i]
                for t, x, u in zip(record.t, truth.x, record.u, strict=True)
            ])  # fmt: skip
            d = truth.d[:, i]
            cosines.append(abs(float(added @ d)) / max(float(np.linalg.norm(added) * np.linalg.norm(d)), 1e-300))
        demand(bool(cosines), f"the library offers no {effect.id} in {entry.equation} of the deficient model")
        demand(max(cosines) > ALIGNED, f"d in {entry.equation} has cosine {max(cosines):.3f} with {effect.id}'s term")
        said.append(f"cosine {max(cosines):.4f} with {effect.id}")
    return ", ".join(said)


def null(case: Case) -> str:
    """A case that lacks nothing has no model error with the true parameters, and is tagged so."""
    if case.missing or case.truth is None:
        raise NotApplicableError("something is missing" if case.missing else "it is measured")
    demand(bool({"null", "wrong-parameter"} & set(case.tags)), 'nothing is missing; tag it "null"')
    right = case.deficient.with_values({name: p.value for name, p in case.truth.parameters.items()})
    demand(
        right == case.deficient or "wrong-parameter" in case.tags,
        'the truth has other parameter values; tag it "wrong-parameter" or mend them',
    )
    truth = replace(case, deficient=right).simulate(0.0, 0)[1]
    demand(not np.any(truth.d), f"d reaches {float(np.max(np.abs(truth.d))):.2g} where nothing is missing")
    return ""


def _simulated(case: Case, noise: float, seed: int) -> tuple[Record, Truth]:
    if case.truth is None:
        raise NotApplicableError("it is measured")
    return case.simulate(noise, seed)


def _in_rates(case: Case) -> tuple[Missing, ...]:
    """The missing effects, where all act in rates of states that model and plant share."""
    if not case.missing or case.truth is None:
        raise NotApplicableError("it is measured" if case.truth is None else "nothing is said to be missing")
    if not all(entry.equation in case.deficient.states for entry in case.missing):
        raise NotApplicableError("what is missing acts in no rate")
    if list(case.truth.states) != list(case.deficient.states):
        raise NotApplicableError("the plant has states of its own")
    return case.missing


def _gap(case: Case, plant: Model, record: Record, truth: Truth) -> float:
    """The largest difference of the rates of a plant and of the deficient model along the true states."""
    return max(
        float(np.max(np.abs(plant.rate(t, x, tuple(u)) - case.deficient.rate(t, x, tuple(u)))))
        for t, x, u in zip(record.t, truth.x, record.u, strict=True)
    )


CHECKS: dict[str, Callable[[Case], str]] = {
    "sentence": sentence,
    "simulates or reads": records,
    "same seed, same record": seeds,
    "model file": file,
    "units": consistent_units,
    "missing effects": missing,
    "model error": model_error,
    "shape of the model error": shape,
    "null": null,
}
