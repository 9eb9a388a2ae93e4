"""What the search counts: the price of an effect, the part of a long record, the directions of a hidden law."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from suite import plugins
from suite.discovery import discrepancy, long, loop, probe, words
from suite.discovery.engine import Problem
from suite.discovery.fit import homotopy, prepare
from suite.discovery.identify import Search, search
from suite.discovery.library import candidates
from suite.model import Initial, Input, Model, Output, Parameter
from suite.record import Record

LINEAR = Model(
    "oscillator",
    {"p": "v", "v": "-c*v - k*p"},
    {"c": Parameter(0.3, sd=0.03), "k": Parameter(4.0, sd=0.2)},
    outputs={"pos": Output("p", "pos", sigma=0.01)},
    initial={"p": Initial(2.0), "v": Initial(0.0)},
)


def swing(samples: int, dt: float, late: float = 0.0) -> Record:
    """An oscillator that is let go at 2 and whose spring is cubic too; `late` pushes it from halfway on."""
    t, half = dt * np.arange(samples), 0.5 * dt * samples

    def rate(now: float, x: np.ndarray) -> list[float]:
        push = late if half < now < half + 2.0 else 0.0
        return [x[1], -0.3 * x[1] - 4.0 * x[0] - (0.0 if late else 0.8) * x[0] ** 3 + push]

    y = solve_ivp(rate, (0.0, t[-1]), [2.0, 0.0], "DOP853", t, rtol=1e-9, atol=1e-11, max_step=0.1).y[0]
    y = y + 0.01 * np.random.default_rng(1).standard_normal(samples)
    return Record(t, np.zeros((samples, 0)), y[:, None])


@pytest.fixture(scope="module")
def found() -> Search:
    """A search among five effects, of which one is a parameter of the model in disguise."""
    effects = {
        name: plugins.effects()[name]
        for name in ("cubic_stiffness", "quadratic_drag", "saturation", "harmonic_forcing", "linear_stiffness")
    }
    record = swing(200, 0.06)
    return search(prepare(LINEAR, record, candidates(LINEAR, effects, False, record)))


def test_the_criterion_is_ebic_for_few_samples(found: Search) -> None:
    """L + k ln N + 2 m ln(library), a tone twice ln(frequencies) more, and 2 K (K + 1) / (N - K - 1) with all K that
    are free (Chen and Chen 2008; Hurvich and Tsai 1989).
    """
    N = found.problem.count
    library = len(found.problem.terms) - len(found.absorbed)
    seen = set()
    for hypothesis in (found.base, *found.fitted):
        terms = [found.problem.terms[k] for k in hypothesis.active]
        own = sum(len(term.names) for term in terms)
        inner = sum(len(term.inner) for term in terms)
        tones = sum(term.effect.id == "harmonic_forcing" for term in terms)
        K = len(LINEAR.parameters) + own
        price = (own) * np.log(N) + 2 * len(terms) * np.log(library) + 2 * tones * np.log(found.frequencies)
        price += 2.0 * K * (K + 1) / (N - K - 1)
        assert found.criterion(hypothesis) == pytest.approx(hypothesis.exact.L + price, rel=1e-9), terms
        assert inner <= own
        seen |= {term.effect.id for term in terms}
    assert {"cubic_stiffness", "quadratic_drag"} <= seen


def test_a_long_record_is_searched_where_the_model_fails() -> None:
    """A push at the middle of 16,000 samples: the block has it, and is as long as it should be."""
    record = swing(16_000, 0.05, late=1.0)
    problem = prepare(LINEAR, record)
    block = long._block(problem, homotopy(problem, problem.start)).record
    assert len(block) == long.BLOCK
    assert block.t[0] < 0.5 * record.t[-1] < block.t[-1]


def test_what_is_tested_twice_counts_once() -> None:
    """Hats that stand where others do are no further directions: the chance is that of the hats alone."""
    problem = prepare(LINEAR, swing(200, 0.06))
    low, width = probe._span(problem, "p")
    chances = []
    for times in (1, 2):
        wide: Problem = problem.with_terms(tuple([probe._hat("v", "p")] * probe.HATS * times))
        point = probe._moved(problem, homotopy(problem, problem.start), wide)
        for k in range(probe.HATS * times):
            point.p[wide.places(k)[1:]] = low + (k % probe.HATS) * width, width
        chances.append(probe._chance(wide, point, (), list(range(probe.HATS * times))))
    assert chances[1] == pytest.approx(chances[0], rel=1e-6, abs=0.0)
    assert 0.0 < chances[0] < 1e-6


def test_an_excerpt_says_what_its_errors_are_of() -> None:
    """Of nothing where none is stated, of the pieces, or of a simulation of all."""
    plain, pieces, whole = (words.excerpt(10_000, 2000, 4, of) for of in (None, False, True))
    assert "the errors stated" not in plain
    assert "errors stated are of these pieces" in pieces
    assert "errors stated are of a simulation of all of them" in whole
    assert all("10000 samples" in said and "2000 of them, in 4 pieces" in said for said in (plain, pieces, whole))


def test_candidates_in_disguise_have_no_part_in_the_price(found: Search) -> None:
    """The library whose size is paid for is what can be told apart."""
    assert len(found.absorbed) == 1
    every = replace(found, absorbed=())
    best = found.fitted[0]
    gap = every.criterion(best) - found.criterion(best)
    many, few = len(found.problem.terms), len(found.problem.terms) - len(found.absorbed)
    assert gap == pytest.approx(2.0 * len(best.active) * (np.log(many) - np.log(few)), abs=1e-9)


def test_the_smoothed_error_is_the_mean_over_likely_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two that are equally likely: half of each, the variance each one's own and their spread; of a large model the
    likeliest alone.
    """
    problem = prepare(LINEAR, swing(200, 0.06))
    walk = discrepancy._walk(problem, problem.model)
    a, b = walk((-4.0,)), walk((-1.0,))

    def mean(*tried: tuple[float, discrepancy.Process]) -> discrepancy.Smooth:
        return discrepancy._average(problem, problem.start, problem.R, 2, tried)

    one, other, both = mean((0.0, a)), mean((0.0, b)), mean((0.0, a), (0.0, b))
    np.testing.assert_allclose(both.d, 0.5 * (one.d + other.d), rtol=1e-10, atol=1e-12)
    spread = 0.25 * (one.d - other.d) ** 2
    np.testing.assert_allclose(both.sd**2, 0.5 * (one.sd**2 + other.sd**2) + spread, rtol=1e-8)
    assert np.abs(one.d - other.d).max() > 0.1
    monkeypatch.setattr(discrepancy, "LARGE", 1)
    np.testing.assert_array_equal(mean((0.0, a), (1.0, b)).d, other.d)


def test_what_discovery_made_of_it_is_told_from_first_to_last(monkeypatch: pytest.MonkeyPatch) -> None:
    """After two steps the errors of the first model and of the last, and how many steps lie between."""
    monkeypatch.setattr(loop, "headline", lambda verdict: "Two are missing.")
    verdicts = [SimpleNamespace(verdict="missing_effect", sentence="The first verdict.")] * 2
    verdicts.append(SimpleNamespace(verdict="adequate", sentence=""))
    steps: Any = [
        SimpleNamespace(comparison=SimpleNamespace(error={"pos": value}, sigma=np.array([0.01])), verdict=verdict)
        for value, verdict in zip((0.3, 0.2, 0.0101), verdicts, strict=True)
    ]
    first: Any = verdicts[0]
    assert loop.conclusion(first, steps[:1]) == "The first verdict."
    assert loop.conclusion(first, steps) == (
        "Two are missing. In 2 steps the error of pos falls from 0.3 to 0.0101 (noise 0.01); what remains is noise."
    )


def test_a_term_is_shown_where_it_stands() -> None:
    """In a rate as it is, at an input or a parameter as what that becomes."""
    model = replace(LINEAR, states={"p": "v", "v": "F - c*v - k*p"}, inputs={"F": Input("F")})
    terms = candidates(model, plugins.effects())
    at_input = {term.shown for term in terms if term.place == "input"}
    assert at_input
    for shown in at_input:
        assert re.fullmatch(r"F -> F [+-] [^+-].*", shown), shown
    assert "-a*p**3" in {term.shown for term in terms if term.place == "rate"}
