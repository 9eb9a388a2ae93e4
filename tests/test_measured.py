"""On held-out measurements the error falls to its target once the missing effect is in the model."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from suite import plugins
from suite.benchmark import held_out
from suite.case import Case, Experiment, Held
from suite.discovery.fit import fit
from suite.errors import DataError, InputError
from suite.model import Initial, Model, Output, Parameter
from suite.record import Record
from suite.report import gallery

CASES = [name for name, case in plugins.cases().items() if case.measured is not None]
POSITIVE = (0.0, np.inf)


def loss(value: float) -> Parameter:
    """A coefficient that cannot be negative and of which nothing else is known."""
    return Parameter(value, free=True, bounds=POSITIVE)


def drag(model: Model) -> Model:
    """With quadratic drag."""
    return model.plus("v", "-a*v*abs(v)", {"a": loss(1e-3)})


def hardening(model: Model) -> Model:
    """With a cubic spring."""
    return model.plus("v", "-a*p**3", {"a": Parameter(0.0, free=True)})


def dry_friction(model: Model) -> Model:
    """With Coulomb friction."""
    return model.plus("v", "-a*tanh(v/1e-3)", {"a": loss(0.2)})


def overflows(model: Model) -> Model:
    """With an upper tank that runs over into the lower one, and water lost where both are full."""
    upper = {"a": loss(0.1), "h": Parameter(8.0, free=True, bounds=(1.0, 20.0))}
    lost = {"b": loss(0.1), "w": Parameter(15.0, free=True, bounds=(5.0, 30.0))}
    return model.plus("upper", "-a*max(upper - h, 0)", upper).plus("both", "-b*max(both - w, 0)", lost)


def tissue(model: Model) -> Model:
    """With a second compartment, which is not empty at the first sample."""
    k = model.parameters["k"]
    return replace(
        model,
        states={"C": f"{model.states['C']} - a*C + b*W", "W": "a*C - b*W"},
        parameters={"k": k, "a": k, "b": k},
        initial={**model.initial, "W": Initial(0.0, estimate=True)},
    )


def bias(model: Model) -> Model:
    """With a voltmeter that is off by a constant, as a current that leaks in."""
    return model.plus("V", "+a", {"a": Parameter(0.0, free=True)})


@dataclass(frozen=True)
class Story:
    """A case: its effect, and by held-out part the error before (known to a few percent) and at most after."""

    case: str
    grown: Callable[[Model], Model]
    errors: Mapping[str, tuple[float, float]]
    fitted: int | None = None  # samples that are enough to fit, where there are very many


STORIES = (
    Story("silverbox", hardening, {"arrow": (14.4e-3, 1.0e-3), "multisine": (7.0e-3, 0.95e-3)}, 20000),
    Story("emps", dry_friction, {"pulses": (0.286, 0.135)}, 2500),
    Story("cascaded-tanks", overflows, {"validation": (0.671, 0.40)}),
    Story("rocket-camoes", drag, {"last 40 %": (132.0, 12.0)}),
    Story("rocket-genesis", drag, {"last 40 %": (113.0, 25.0)}),
    Story("rocket-andromeda", drag, {"last 40 %": (76.7, 16.0)}),
    Story("rocket-erebus", drag, {"last 40 %": (114.0, 5.0)}),
    Story("whiffle-ball", drag, {"last run": (2.58, 0.25)}),
    Story("whiffle-ball-2", drag, {"drop 2": (2.47, 0.51)}),
    Story("yellow-whiffle-ball", drag, {"drop 2": (3.12, 0.66)}),
    Story("volleyball", drag, {"drop 2": (1.10, 0.2)}),
    Story("tennis-ball", drag, {"drop 2": (1.18, 0.35)}),
    Story("blue-basketball", drag, {"drop 2": (0.625, 0.26)}),
    Story("green-basketball", drag, {"drop 2": (0.449, 0.15)}),
    Story("baseball", drag, {"drop 2": (0.176, 0.17)}),
    Story("capacitor", bias, {"last 30 %": (0.0918, 0.0095)}),
    Story("indometacin", tissue, {"subject 6": (0.129, 0.04)}),
    Story("cefamandole", tissue, {"subject 6": (12.9, 6.0)}),
)


def there(case: Case) -> tuple[Record, dict[str, Held]]:
    """The case's parts; the test is skipped with the reason where its data are not there."""
    try:
        train, held = held_out.parts(case, None)
    except DataError as error:
        pytest.skip(str(error))
    return train, dict(held)


@pytest.mark.parametrize("name", CASES)
def test_what_is_judged_is_of_the_same_kind_and_never_fitted(name: str) -> None:
    """Fitted and judged parts have the model's columns; a judged sample is in no fitted run."""
    case = plugins.cases()[name]
    train, held = there(case)
    shape = (len(case.deficient.inputs), len(case.deficient.outputs))
    seen = {row.tobytes() for row in np.column_stack([train.t, train.u, train.y])}
    for part in held.values():
        assert (part.record.u.shape[1], part.record.y.shape[1]) == shape
        assert part.first < len(part.record)
        judged = np.column_stack([part.record.t, part.record.u, part.record.y])[part.first :]
        # A sensor that reads in steps may read the same twice.
        assert sum(row.tobytes() in seen for row in judged) < 0.2 * len(judged)
        assert part.lead is None or part.lead <= max(part.first, 50)


@pytest.mark.parametrize("story", STORIES, ids=lambda story: story.case)
def test_the_missing_effect_brings_the_error_to_its_target(story: Story) -> None:
    """Fitted to the training part alone, the deficient model errs as published and the grown one as it should."""
    case = plugins.cases()[story.case]
    train, held = there(case)
    train = train if story.fitted is None else train.part(0, story.fitted)
    deficient = fit(case.deficient, train).model
    grown = fit(story.grown(case.deficient), train).model
    (output,) = case.deficient.outputs
    for part, (before, after) in story.errors.items():
        assert held_out.error(deficient, held[part])[output] == pytest.approx(before, rel=0.04)
        assert held_out.error(grown, held[part])[output] <= after


def test_a_simulation_that_runs_away_has_no_error_to_show() -> None:
    """A model that diverges on the held-out part is infinitely wrong, not zero."""
    model = Model("explosion", {"x": "x**3"}, outputs={"x": Output("x", column="x")}, initial={"x": Initial(1.0)})
    t = np.linspace(0.0, 10.0, 40)
    record = Record(t, np.zeros((40, 0)), np.ones((40, 1)))
    assert held_out.error(model, Held(record, lead=20, first=20))["x"] == np.inf


def test_a_pattern_without_a_case_is_refused() -> None:
    """`--only` names what there is."""
    with pytest.raises(InputError, match="cooling-mug"):
        held_out.chosen("no such thing")


def test_a_case_without_its_data_is_a_row_with_the_reason(tmp_path: Path) -> None:
    """`bench measured` says where to get what is not there, in every file that it writes."""
    asked = argparse.Namespace(only="emps", data=tmp_path, output=tmp_path / "out", json=False)
    assert held_out.verb(asked) == 0
    for name in ("measured.txt", "measured.csv", "measured.json"):
        text = (tmp_path / "out" / name).read_text(encoding="utf-8")
        assert "nonlinearbenchmark.org" in text
        assert "sha256" in text


def test_a_case_is_judged_on_the_part_that_discovery_never_saw(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A row has the errors of the refitted and of the amended model, what was named, and whether the target is met."""
    spring = Model(
        "spring",
        {"p": "v", "v": "2.5*cos(t) - c*v - k*p"},
        {"c": Parameter(0.68, sd=0.05), "k": Parameter(1.0, sd=0.05)},
        outputs={"pos": Output("p", "pos", sigma=0.05)},
        initial={"p": Initial(0.0), "v": Initial(0.0)},
    )
    true = spring.plus("v", "-a*p**3", {"a": Parameter(0.05)})
    experiment = Experiment(30.0, 0.05, (0.0, 0.0))
    record, _ = Case("spring", "", spring, true, experiment).simulate(0.03, 1)
    case = Case("spring", "", spring, measured=lambda folder: record)
    monkeypatch.setattr(plugins, "cases", lambda: {"spring": case})
    offered = {name: plugins.effects()[name] for name in ("cubic_stiffness", "quadratic_drag")}
    monkeypatch.setattr(plugins, "effects", lambda: offered)
    for target, effects, said in (
        (0.1, ("cubic_stiffness",), "yes"),
        (0.1, ("quadratic_drag",), "effect"),
        (1e-3, ("cubic_stiffness",), "error"),
        (1e-3, ("quadratic_drag",), "no"),
    ):
        monkeypatch.setattr(held_out, "TARGETS", {("spring", "last 30 %"): held_out.Target(target, effects)})
        asked = argparse.Namespace(only="spring", data=None, output=tmp_path, json=False)
        assert held_out.verb(asked) == 0
        assert f" {said} " in capsys.readouterr().out
    (row,) = json.loads((tmp_path / "measured.json").read_text(encoding="utf-8"))
    assert row["named"] == ["cubic_stiffness in v"]
    assert (row["part"], row["output"], row["verdict"], row["end"]) == (
        "last 30 %",
        "pos",
        "missing_effect",
        "adequate",
    )
    sigma = 0.03 * record.y.std()
    assert row["after"] == pytest.approx(sigma, rel=0.15)
    assert row["before"] > 1.4 * sigma
    # The parameters are those of the model that discovery ended with.
    assert row["parameters"]["a"] == pytest.approx(0.05, rel=0.05)
    assert row["samples"] < 0.75 * len(record)
    table = (tmp_path / "measured.csv").read_text(encoding="utf-8")
    assert "plausible" not in table
    assert "cubic_stiffness" in table
    # The picture of the row is drawn of a model built again from it, and refuses a row that is not of this case.
    drawn = gallery.picture(case, row, None, offered)
    assert f"falls from {row['before']:.3g} to {row['after']:.3g}" in str(drawn.get_label())
    with pytest.raises(DataError, match="bench measured"):
        gallery.picture(case, {**row, "after": 2.0 * row["after"]}, None, offered)
    with pytest.raises(DataError, match="no candidate"):
        gallery.picture(case, {**row, "named": ["no_such in v"]}, None, offered)
    # Of a model that lacks nothing there is one error, before and after.
    whole = Case("whole", "", true.with_values({"a": 0.05}), measured=lambda folder: record)
    (row,) = held_out.judge(whole, None, offered)
    assert (row["named"], row["verdict"], row["end"], row["target"]) == ([], "adequate", "adequate", None)
    assert row["before"] == row["after"] == pytest.approx(sigma, rel=0.15)
