"""The rules of a plan: fewer seeds, sizes and variants, and whose tuned values serve whom."""

from __future__ import annotations

from pathlib import Path

import pytest

from suite import plugins
from suite.benchmark import matrix, plan
from suite.benchmark.rules import Rule, allowed, tuners
from suite.benchmark.store import Store
from suite.errors import InputError


def test_the_narrowest_of_the_rules_that_hold_counts() -> None:
    """Seeds are the least of all, a size or a variant that one rule leaves out is out; others keep everything."""
    rules = (
        Rule(("ekf*",), "slow", seeds=5),
        Rule(("ekf-*",), "slower", seeds=2, most_states=4),
        Rule(("ukf",), "once", variants=("default",)),
    )
    assert allowed(rules, "ekf", "tuned", 2, 20) == 5
    assert allowed(rules, "ekf-rts", "tuned", 4, 20) == 2
    assert allowed(rules, "ekf-rts", "tuned", 5, 20) == 0
    assert allowed(rules, "ukf", "tuned", 2, 20) == 0
    assert allowed(rules, "ukf", "q_scale=2", 2, 20) == allowed(rules, "sra", "tuned", 2, 20) == 20


def test_values_are_borrowed_only_where_the_same_numbers_are_tuned() -> None:
    """A method that tunes something else is named in the refusal."""
    tuning = {"a": {"q": ()}, "b": {"q": ()}, "c": {"w": ()}}
    assert tuners([Rule(("b",), "same", tuned_as="a"), Rule(("c",), "own")], tuning) == {"b": "a"}
    with pytest.raises(InputError, match=r"same numbers as c"):
        tuners([Rule(("*",), "all", tuned_as="a")], tuning)


@pytest.mark.parametrize("name", [name for name in plan.shipped() if plan.load(name).kind == "estimation"])
def test_the_rules_of_the_shipped_plans_hold(name: str) -> None:
    """Whoever borrows values has an estimator to borrow from, which is tuned in that plan."""
    found = plan.load(name)
    tuned = {cell.estimator for cell in found.cells() if cell.variant == "tuned"}
    assert set(found.tuned_as.values()) <= tuned
    assert set(found.tuned_as) <= set(plugins.estimators())


def test_one_tuning_serves_two_methods(tmp_path: Path) -> None:
    """The cubature filter is run with the EKF's values: one tuning is stored, both rows have its numbers."""
    source = {
        "sentence": "borrowed", "cases": ["falling-ball"], "estimators": ["ekf", "ckf"], "variants": ["tuned"],
        "noises": [0.05], "seeds": 1,
        "rules": [{"estimators": ["ckf"], "tuned_as": "ekf", "because": "the same process noise"}],
    }  # fmt: skip
    borrowed = plan.parse(source, "borrowed", "borrowed.toml")
    how = matrix.Running(jobs=1, quiet=True, tuned_as=borrowed.tuned_as)
    with Store(tmp_path / "store.sqlite") as store:
        done = matrix.run(borrowed.cells(), store, how)
        rows = {row["estimator"]: row for row in store.rows()}
        count = store.connection.execute("SELECT COUNT(*) FROM tunings").fetchone()[0]
        again = matrix.run(borrowed.cells(), store, how)
    assert done["status"] == {"ok": 2}
    assert count == 1
    assert rows["ekf"]["tuning"] == rows["ckf"]["tuning"] != {}
    assert rows["ckf"]["tuned_as"] == "ekf"
    assert "tuned_as" not in rows["ekf"]
    assert again["unchanged"] == 2
