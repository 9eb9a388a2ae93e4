"""Reference rows are right where the answer is known, stand apart, and the published twin experiments come out."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from suite import plugins
from suite.benchmark import cells, claims_twin, matrix, plan, references, statistics, twin
from suite.benchmark.store import Store
from suite.benchmark.worker import Failure, Task
from suite.case import Case, Experiment
from suite.errors import DataError
from suite.model import Initial, Model, Output, Parameter
from suite.prior import default_prior

LINEAR = Model(
    name="oscillator",
    states={"p": "v", "v": "-c*v - 2*p"},
    parameters={"c": Parameter(0.1)},
    outputs={"p": Output("p", "p"), "v": Output("v", "v")},
    initial={"p": Initial(1.0, estimate=True), "v": Initial(0.0, estimate=True)},
)
CASE = Case("oscillator", "", LINEAR, LINEAR, Experiment(10.0, 0.1, (1.0, 0.5)))


def row(name: str, case: Case, noise: float, seed: int) -> dict:
    """The row of a reference as the matrix makes it."""
    record, truth = case.simulate(noise, seed)
    record = record.with_prior(default_prior(case.deficient, record, truth.noise))
    return references.row(name, case, record, truth)


@pytest.mark.parametrize("kind", ["", "-smoother"])
def test_the_bound_is_the_error_of_the_best_linear_estimate(kind: str) -> None:
    """On a linear plant without process noise the bound is that of least squares for the first state, to 1e-5."""
    record, truth = CASE.simulate(0.1, 0)
    steps = np.array([LINEAR.transition(0.0, np.zeros(2), (), 0.1)[1]] * len(record))
    steps[0] = np.eye(2)
    move = [steps[0]]
    for F in steps[1:]:
        move.append(F @ move[-1])
    information = np.cumsum([M.T @ np.diag(truth.noise**-2) @ M for M in move], axis=0)
    used = information if kind == "" else np.broadcast_to(information[-1], information.shape)
    P = np.array([M @ np.linalg.inv(J) @ M.T for M, J in zip(move, used, strict=True)])
    wanted = np.sqrt(np.einsum("kii->ki", P).mean(axis=0))
    found = row(f"posterior-crb{kind}", CASE, 0.1, 0)
    np.testing.assert_allclose(list(found["state_rmse"].values()), wanted, rtol=1e-5)
    # There is no noise of a seed in it, but for the width of the prior, which is that of what was measured.
    other = row(f"posterior-crb{kind}", CASE, 0.1, 1)
    assert other["state_nrmse"] == pytest.approx(found["state_nrmse"], rel=1e-6)


def test_the_oracle_meets_the_bound_and_no_estimator_beats_it() -> None:
    """Mean squares over 25 seeds: the oracle's within 20 % of the bound (from above, less its scatter), the EKF's
    more.
    """
    bound = row("posterior-crb", CASE, 0.1, 0)["state_nrmse"]
    smooth = row("posterior-crb-smoother", CASE, 0.1, 0)["state_nrmse"]
    assert smooth < bound
    found = {
        name: [row(name, CASE, 0.1, seed)["state_nrmse"] for seed in range(25)]
        for name in ("oracle", "oracle-smoother")
    }
    assert 0.85 < np.sqrt(np.mean(np.square(found["oracle"]))) / bound < 1.2
    assert 0.8 < np.sqrt(np.mean(np.square(found["oracle-smoother"]))) / smooth < 1.25
    record, truth = CASE.simulate(0.1, 0)
    record = record.with_prior(default_prior(LINEAR, record, truth.noise))
    plain = plugins.estimators()["ekf"].estimate(LINEAR, record).x - truth.x
    assert np.sqrt(np.mean((plain / truth.x.std(axis=0)) ** 2)) > 1.5 * bound


def test_on_a_chaotic_plant_the_oracle_is_near_the_bound() -> None:
    """Lorenz-63 without model error: between 0.8 and 2 times the bound, far below the sensors' own error."""
    case = plugins.cases()["null-lorenz"]
    found = {name: row(name, case, 0.05, 0)["state_nrmse"] for name in references.REFERENCES}
    assert 0.8 < found["oracle"] / found["posterior-crb"] < 2.0
    assert found["posterior-crb-smoother"] < found["posterior-crb"] < 0.3 * found["trust-the-sensor"]


def test_trusting_the_sensor_costs_its_noise() -> None:
    """Its error is the sensors' noise; the last reading stands in for a missing one; a hidden state is a reason."""
    assert row("trust-the-sensor", CASE, 0.1, 0)["state_nrmse"] == pytest.approx(0.1, rel=0.15)
    record, truth = CASE.simulate(0.1, 0)
    y = record.y.copy()
    y[[0, 5, 6], 0] = np.nan
    given = replace(record, y=y).with_prior(default_prior(LINEAR, record, truth.noise))
    shifted = replace(truth, x=np.column_stack([y[[1, *range(1, 5), 4, 4, *range(7, len(y))], 0], y[:, 1]]))
    assert references.row("trust-the-sensor", CASE, given, shifted)["state_nrmse"] == 0.0
    hidden = replace(CASE, deficient=replace(LINEAR, outputs={"p": LINEAR.outputs["p"]}))
    hidden = replace(hidden, truth=hidden.deficient)
    assert row("trust-the-sensor", hidden, 0.1, 0)["reason"] == "no sensor reads v alone"


def test_a_bound_of_zero_is_not_drawn() -> None:
    """Where the first state is known, or a sensor has no noise, the row says that the error may vanish."""
    known = replace(LINEAR, initial={"p": Initial(1.0), "v": Initial(0.5)})
    sure = replace(CASE, deficient=known, truth=known)
    assert "the first state is known" in row("posterior-crb", sure, 0.1, 0)["reason"]
    assert "no noise" in row("posterior-crb", CASE, 0.0, 0)["reason"]


def test_the_oracle_knows_the_state_that_the_model_lacks() -> None:
    """Of a plant with a state of its own it gives the deficient model's states and d, far better than an EKF."""
    case = plugins.cases()["bouc-wen"]
    assert case.truth is not None
    assert len(case.truth.states) > len(case.deficient.states)
    found = row("oracle", case, 0.05, 0)
    plain = cells.run(cells.Cell("bouc-wen", 0.05, "ekf", "default", 0), {}, None)
    assert found["state_nrmse"] < 0.2 * plain["state_nrmse"]
    assert found["d_nrmse"] < 0.05
    assert "parameter_worst" not in found


class Late(matrix.Running):
    """Every cell takes too long."""

    def results(self, tasks: Iterator[Task | None], limit: float) -> Iterator[tuple[Task, Failure]]:
        yield from ((task, Failure("time-out", f"not done after {limit:g} s")) for task in tasks if task is not None)


def test_a_reference_that_is_ended_stays_a_reference(tmp_path: Path) -> None:
    """The row of a reference whose time is up has kind "reference" and says why it has no numbers."""
    with Store(tmp_path / "store.sqlite") as store:
        cell = cells.Cell("paper-cubic", 0.05, "posterior-crb-smoother", references.VARIANT, 0)
        done = matrix.run([cell], store, Late(quiet=True))
        row = store.rows()[0]
    assert done["status"] == {"time-out": 1}
    assert (row["kind"], row["status"]) == ("reference", "time-out")


def test_references_stand_in_the_matrix_and_apart() -> None:
    """A plan lists them once a seed as variant "reference", untuned, not for measured cases; they are no estimators."""
    chosen = plan.parse({"cases": ["paper-cubic", "cooling-mug"], "seeds": 2, "noises": [0.05]}, "p", "p")
    mine = [cell for cell in chosen.cells() if cell.estimator in references.REFERENCES]
    assert {(c.case, c.variant) for c in mine} == {("paper-cubic", "reference")}
    assert len(mine) == 2 * len(references.REFERENCES)
    assert not set(references.REFERENCES) & set(plugins.estimators())
    made = cells.run(mine[0], {}, None)
    assert (made["kind"], made["status"]) == ("reference", "ok")
    for cell in mine:
        # A cell that never answered has no numbers, and is still no method in the race.
        assert statistics.is_reference({**asdict(cell), "status": "time-out"})
    assert not statistics.is_reference({"estimator": "ekf", "variant": "default", "status": "time-out"})
    assert statistics.is_reference({**asdict(mine[0]), **made})
    only = plan.parse({"cases": ["paper-cubic"], "estimators": ["oracle"], "variants": ["tuned"], "seeds": 1}, "p", "p")
    assert {cell.estimator for cell in only.cells()} == {"oracle"}


def test_the_extended_filter_makes_the_published_error() -> None:
    """Lorenz-63 of Sakov and others (2012): 0.92 within 10 % as the mean of four runs of 1000 readings."""
    errors = [twin.error("extkf", seed) for seed in range(4)]
    assert np.mean(errors) == pytest.approx(0.92, rel=0.1)


def test_a_transformed_ensemble_is_exact_in_mean_and_spread() -> None:
    """One update of many members is the Kalman update of their own mean and covariance, to rounding."""
    model, record, prior, _ = twin.experiment(0, 1)
    record = replace(record, y=record.y[[1, 1]])
    x = twin.transformed(model, record, prior, 3, members=12, inflation=1.0)
    E = prior.x0 + np.random.default_rng(3).standard_normal((12, 3)) @ np.sqrt(prior.P0)
    P = np.cov(E.T)
    K = P @ np.linalg.inv(P + np.diag(prior.R))
    np.testing.assert_allclose(x[0], E.mean(axis=0) + K @ (record.y[0] - E.mean(axis=0)), atol=1e-10)


def test_long_runs_come_from_the_file_with_their_date(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`bench twin` writes what the ledger reads; without it the row says how to make it; another file is refused."""
    path = tmp_path / "twin.json"
    monkeypatch.setattr(claims_twin, "PLACES", (path,))
    monkeypatch.setattr(claims_twin, "ON_THE_SPOT", ())
    monkeypatch.setattr(twin, "METHODS", {"extkf": twin.METHODS["extkf"]})
    (empty,) = claims_twin.rows()
    assert (empty["ours"], empty["status"]) == (None, "not computed")
    assert "unmodelled bench twin -o results/twin.json" in empty["setting"]
    made = twin.write(path, seeds=2)
    (full,) = claims_twin.rows()
    assert full["ours"] == pytest.approx(np.mean(made["errors"]["extkf"]))
    assert full["status"] == "reproduced"
    assert made["date"] in full["setting"]
    path.write_text(json.dumps({"errors": 3}))
    with pytest.raises(DataError, match="not a file of `unmodelled bench twin`"):
        claims_twin.rows()
