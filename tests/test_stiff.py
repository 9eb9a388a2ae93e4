"""Plants that are too fast for the steps of their record: solved, or refused with the mend; and such as run away."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp

from suite import plugins
from suite.discovery.misfit import compare
from suite.discovery.verdict import diagnose
from suite.errors import ModelError
from suite.model import Model
from suite.model_file import from_toml
from suite.record import Record

Array = npt.NDArray[np.float64]


def fast(rate: str) -> tuple[Model, Record]:
    """A sensor that settles at a rate of z, behind a plant whose decay lacks a cubic part."""
    model = from_toml(
        f"""
        states.x = "-{rate}*(x - z)"
        states.z = "u - r*z"
        parameters.r = {{value = 1.0, sd = 0.2}}
        inputs.u = {{column = "u", hold = "linear"}}
        outputs.y = {{equation = "x", column = "y"}}
        initial.x = {{value = 0.0, estimate = true}}
        initial.z = {{value = 0.0, estimate = true}}
        """
    )
    t = 0.05 * np.arange(200)
    y = slow(t) + 0.005 * np.random.default_rng(0).standard_normal(200)
    return model, Record(t, np.sin(t)[:, None], y[:, None])


def slow(t: Array) -> Array:
    """z' = sin t - z - 0.3 z^3 from rest, by scipy."""
    found = solve_ivp(lambda s, z: np.sin(s) - z - 0.3 * z**3, (0.0, t[-1]), [0.0], t_eval=t, rtol=1e-9, atol=1e-12)
    return np.asarray(found.y[0])


def test_a_stiff_plant_is_solved() -> None:
    """Five hundred times faster than a step, and the law of the slow state is still found."""
    model, record = fast("1e4")
    verdict = diagnose(model, record, plugins.effects())
    assert verdict.verdict == "missing_effect"
    assert [(e.effect, e.equation) for e in verdict.effects] == [("cubic_coupling", "z")]


@pytest.mark.parametrize("rate", ["1e5", "1e9", "1e6*z*z"])
def test_a_plant_too_stiff_for_the_steps_is_refused(rate: str) -> None:
    """At once, or as soon as it becomes so."""
    model, record = fast(rate)
    for analysis in (lambda: diagnose(model, record, plugins.effects()), lambda: compare(model, record)):
        with pytest.raises(
            ModelError, match=r"\[states\] x: too fast for these data; its rate is .* at most 1.38e\+04"
        ):
            analysis()


def test_a_plant_that_runs_away_explains_nothing() -> None:
    model, record = fast("(-1e3)")
    said = compare(model, record).sentence
    assert "nothing of y, for its free run leaves the finite numbers" in said
    assert "nan" not in said
    assert "inf" not in said.replace("finite", "")


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # as on the command line: sensitivities overflow
def test_an_infinite_error_is_a_word() -> None:
    """A verdict on a plant that runs away holds no nan and no inf among its words."""
    model, record = fast("(-1e3)")
    said = diagnose(model, record, plugins.effects()).sentence
    assert not {"nan", "inf"} & set(re.findall(r"[a-z]+", said))
