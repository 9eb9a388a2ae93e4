"""A grid of keyword values in a plan is a variant a point, for the estimators that take it."""

from __future__ import annotations

import pytest

from suite import plugins
from suite.benchmark import grids
from suite.benchmark.plan import parse
from suite.errors import InputError


def test_a_grid_is_a_variant_a_point() -> None:
    """The product of all values, each read back from its label; other entries keep their variants."""
    table = {
        "cases": ["paper-cubic"], "noises": [0.05], "seeds": 1, "variants": ["default"],
        "estimators": ["generalized-ie[alpha=0.1,1e3,riccati=transition,integration]", "ekf"],
    }  # fmt: skip
    cells = parse(table, "grid", "grid.toml").cells()
    labels = [cell.variant for cell in cells if cell.estimator == "generalized-ie"]
    assert [cell.variant for cell in cells if cell.estimator == "ekf"] == ["default"]
    assert [grids.values(label) for label in labels] == [
        {"alpha": alpha, "riccati": riccati} for alpha in (0.1, 1000) for riccati in ("transition", "integration")
    ]


def test_a_pattern_with_a_grid_means_those_that_take_it() -> None:
    """`*[alpha=1]` is every estimator with an alpha, and none else."""
    picked = grids.chosen(["*[alpha=1]"], plugins.estimators())
    takers = {name for name, method in plugins.estimators().items() if "alpha" in (grids.keywords(method) or ())}
    assert set(picked) == takers > {"generalized-ie"}


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("ekf[q=1]", "ekf has no keyword argument 'q'; it has q_scale"),
        ("ekf[q_scale=large]", "q_scale of ekf is a number, not 'large'"),
        ("generalized-ie[riccati=fast]", "riccati of generalized-ie is one of transition, integration, not fast"),
        ("ekf[q_scale=1", "is not a grid"),
        ("ekf[q_scale=1,q_scale=2]", "is given twice"),
        ("nothing[q_scale=1]", "no estimator is named like 'nothing'"),
    ],
)
def test_a_grid_that_no_estimator_takes_is_refused(entry: str, said: str) -> None:
    """One sentence says which keyword or value is wrong."""
    with pytest.raises(InputError, match="(?s)" + said.replace("[", r"\[").replace("'", ".")):
        parse({"estimators": [entry]}, "grid", "grid.toml").cells()
