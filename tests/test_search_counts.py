"""What the search counts: the price of an effect, the part of a long record, the directions of a hidden law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from suite import plugins
from suite.discovery import long, probe, words
from suite.discovery.engine import Problem
from suite.discovery.fit import homotopy, prepare
from suite.discovery.identify import Search, search
from suite.discovery.library import candidates
from suite.model import Initial, Model, Output, Parameter
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
    """A search among four effects."""
    effects = {
        name: plugins.effects()[name]
        for name in ("cubic_stiffness", "quadratic_drag", "saturation", "harmonic_forcing")
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


def test_a_search_that_is_replaced_keeps_its_price(found: Search) -> None:
    """The library of the price is what can be told apart: candidates in disguise cost nothing."""
    every = replace(found, absorbed=())
    best = found.fitted[0]
    gap = every.criterion(best) - found.criterion(best)
    many, few = len(found.problem.terms), len(found.problem.terms) - len(found.absorbed)
    assert gap == pytest.approx(2.0 * len(best.active) * (np.log(many) - np.log(few)), abs=1e-9)
