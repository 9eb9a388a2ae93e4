"""The files of docs/examples are plug-ins under 40 lines that pass every check, and each is good for something."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from suite import plugins
from suite.__main__ import main
from suite.discovery.verdict import diagnose
from suite.metric import Judged
from suite.model import Initial, Model, Output, Parameter
from suite.prior import default_prior
from suite.record import Record

DOCS = Path(__file__).parents[1] / "docs"
EXAMPLES = DOCS / "examples"
INCLUDED = {"plugins.md": ["observer.py", "tank_leak.py", "magnet.py"], "metrics.md": ["peak_error.py"]}

pytestmark = pytest.mark.skipif(
    not DOCS.is_dir(), reason="the documentation is in a checkout, not beside an installed package"
)


def loaded(name: str) -> ModuleType:
    """One of the files as a module."""
    spec = importlib.util.spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_pages_include_every_file_and_each_is_short() -> None:
    """What stands in the folder stands in a page, and nothing there is above 40 lines."""
    for page, names in INCLUDED.items():
        text = (DOCS / page).read_text(encoding="utf-8")
        assert re.findall(r'--8<-- "examples/(\w+\.py)"', text) == names
    assert {path.name for path in EXAMPLES.glob("*.py")} == {name for names in INCLUDED.values() for name in names}
    for path in EXAMPLES.glob("*.py"):
        assert len(path.read_text(encoding="utf-8").splitlines()) < 40


def test_the_files_of_the_page_pass_their_tests(capsys: pytest.CaptureFixture[str]) -> None:
    """An estimator, a case and an effect, as they stand in the page."""
    assert main(["test", *(str(EXAMPLES / name) for name in INCLUDED["plugins.md"]), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["failed"] == 0
    assert {entry["kind"] for entry in found["checks"]} == {"estimators", "cases", "effects"}


def test_the_observer_sees_the_leak_of_the_case_and_the_metric_judges_it() -> None:
    """Its d follows the true model error, and the metric is the worst error over the spread."""
    case, observer = loaded("tank_leak").CASE, loaded("observer").Observer()
    record, truth = case.simulate(0.01, 1)
    record = record.with_prior(default_prior(case.deficient, record, truth.noise))
    estimate = observer.estimate(case.deficient, record)
    assert np.corrcoef(estimate.d[20:, 0], truth.d[20:, 0])[0, 1] > 0.5
    metric = loaded("peak_error").PEAK_ERROR
    worst = np.abs(estimate.x - truth.x).max() / truth.x.std()
    assert metric.value(Judged(case, record, truth, estimate, "filter")) == pytest.approx(worst)
    assert metric.value(Judged(case, record, None, estimate, "filter")) is None


def test_the_leak_of_the_case_is_found() -> None:
    """An outflow by the root of the level is named, with the coefficient that the case states.

    No equation of the model depends on the level itself, so effects that do have to be allowed (`--absolute`).
    """
    case = loaded("tank_leak").CASE
    verdict = diagnose(case.deficient, case.simulate(0.01, 1)[0], plugins.effects(), absolute=True)
    assert [named.effect for named in verdict.effects] == ["outflow"]
    coefficient = verdict.effects[0].coefficients["a"]
    assert abs(coefficient.value - 0.2) < 4 * coefficient.sd


def test_the_magnet_is_found_where_one_is() -> None:
    """With the file in the library a pull near the middle gets its name; the library alone has none for it."""
    effect = loaded("magnet").EFFECT
    model = Model(
        name="slider past a magnet",
        states={"p": "v", "v": "-0.1*v - 2*p"},
        outputs={"p": Output("p", column="p")},
        initial={"p": Initial(1.5), "v": Initial(0.0)},
    )
    plant = model.plus("v", "-a*p/(1 + (p/w)**2)**2", {"a": Parameter(6.0), "w": Parameter(0.4)})
    t = np.arange(401) * 0.05
    x = np.zeros((len(t), 2))
    x[0] = 1.5, 0.0
    for k in range(len(t) - 1):
        x[k + 1] = plant.step(t[k], x[k], (), 0.05)
    y = x[:, :1] + 0.01 * np.random.default_rng(3).standard_normal((len(t), 1))
    verdict = diagnose(model, Record(t, np.zeros((len(t), 0)), y), plugins.effects() | {effect.id: effect})
    assert [named.effect for named in verdict.effects] == ["magnet"]
    assert abs(verdict.effects[0].coefficients["a"].value - 6.0) < 0.5
