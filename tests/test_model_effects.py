"""A user's own effects: read with every defect in one sentence, found where they are what is missing, and added."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from suite import plugins
from suite.__main__ import main
from suite.discovery.library import candidates
from suite.discovery.verdict import diagnose
from suite.errors import ModelError
from suite.model import Parameter
from suite.model_effects import KEYS
from suite.model_file import from_toml, read_model
from suite.record import Record


def mine(more: str = "", **keys: str) -> str:
    """A model with one effect of its own, some of its keys replaced, left out or added."""
    given = {
        "id": '"magnet"',
        "term": '"-a*exp(-p/w)"',
        "roles": '{ p = "position", v = "rate" }',
        "inner": '{ w = { of = "spread", start = 0.1, low = 0.01, high = 1.0 } }',
    } | keys
    model = '[states]\np = "v"\nv = "-k*p + F"\n[parameters]\nk = 4.0\n[inputs]\nF = "force"\n'
    return model + "[[effects]]\n" + "".join(f"{key} = {text}\n" for key, text in given.items() if text) + more


DEFECTS = {
    "effects as one table": (
        "[states]\nx = '0'\n[effects]\nid = 'magnet'\n",
        "[[effects]]: expected tables, got a table; write [[effects]] above each",
    ),
    "no id": (mine(id=""), '[[effects]] number 1: no id; write id = "magnet"'),
    "no name": (mine(id="'a b'"), "[[effects]] number 1 id: 'a b' is no name; use letters, digits and _"),
    "id twice": (mine("[[effects]]\nid='magnet'\nterm='a'\nequation='v'"), "magnet: the id is given twice; rename one"),
    "id of the library": (mine(id="'radiation'"), "[[effects]] radiation: the library has an effect of this id"),
    "no term": (mine(term=""), '[[effects]] magnet: no term; write term = "-a*p**3"'),
    "unknown role": (
        mine(roles="{ p = 'place' }"),
        "[[effects]] magnet roles p: 'place' is no role; choose one of position",
    ),
    "unknown letter": (
        mine(term="'-a*q*exp(-p/w)'"),
        "magnet term: 'q' is not declared; add it to roles, coefficients, inner or states, or use the model's own",
    ),
    "unknown name": (
        mine(term="'-a*q*exp(-p/w)'", roles="", equation="'v'"),
        "magnet term: 'q' is not declared; add it to coefficients, inner or states, or declare it in the model",
    ),
    "unknown name in a state": (
        mine(term="'-a*z*exp(-p/w)'", states="{ z = { rate = 'v - q' } }"),
        "magnet states z: 'q' is not declared",
    ),
    "no rate": (mine(states="{ z = { start = '0' } }"), "magnet states z: no rate; write z = { rate ="),
    "no place": (mine(roles=""), "magnet: neither roles nor equation; write roles = { p ="),
    "two places": (mine(equation="'v'"), "magnet: both roles and equation; write roles = { p ="),
    "roles of two places": (
        mine(roles="{ p = 'position', u = 'input' }"),
        "roles: input and position do not go together",
    ),
    "late without input": (mine(roles="{ p = 'late' }"), "roles: late needs an input; add one such as u ="),
    "no such equation": (mine(roles="", equation="'q'"), "equation: the model has no 'q'; choose one of p, v, F"),
    "bounds of a scale": (
        mine(inner="{ w = { of = 'spread', start = 2, low = 0.01, high = 1 } }"),
        "inner w: start 2 with low 0.01 and high 1; order them: low <= start <= high",
    ),
    "a scale of zero": (
        mine(inner="{ w = { of = 'time', start = 1, low = 0, high = 1 } }"),
        "inner w: low is 0; a scale is positive",
    ),
    "half a scale": (mine(inner="{ w = { of = 'spread' } }"), "inner w: it needs of, start, low and high; write w ="),
    "a scale of nothing": (
        mine(inner="{ w = { of = 'width', start = 1, low = 1, high = 2 } }"),
        "inner w: of is 'width'; choose one of spread, range",
    ),
    "no use": (mine(coefficients="['a', 'b']"), "magnet: b stands nowhere in the term; use b in it, or leave b out"),
    "no coefficient": (mine(coefficients="[]"), "coefficients: the list is empty; write coefficients ="),
    "two things": (
        mine(coefficients="['a', 'p']", term="'-a*p*exp(-p/w)'"),
        "magnet: p is two things at once; rename one",
    ),
    "taken by the language": (mine(coefficients="['sin']"), "'sin' cannot be a name here"),
    "not gone at zero": (mine(term="'-a*p - exp(-p/w)'"), "term: with a = 0 it leaves -exp(-p/w); multiply each part"),
    "sign": (mine(sign="-1"), "sign: expected 0 or 1, got -1; write 1"),
    "misspelt key of an effect": (mine(sentense="'x'"), "'sentense' is not known here (did you mean sentence?)"),
    "no equation in a term": (mine(term="'-a*exp(-p/w'"), "magnet term: '-a*exp(-p/w' is not an equation"),
}


@pytest.mark.parametrize(("text", "sentence"), DEFECTS.values(), ids=DEFECTS.keys())
def test_every_defect_of_an_effect_is_one_sentence(text: str, sentence: str) -> None:
    """The effect and its key, what came, and what to write instead."""
    with pytest.raises(ModelError) as refusal:
        from_toml(text, "plant.toml")
    said = str(refusal.value)
    assert sentence in said
    assert said.startswith("plant.toml, [[effects]]")
    assert ";" in said
    assert "\n" not in said


def test_an_effect_of_the_models_own_is_a_candidate_where_it_says() -> None:
    """By roles as the library's are; by its equation exactly once, in the model's names, which its own names hide."""
    text = mine("[[effects]]\nid='wind'\nequation='p'\nterm='a*k*F*tanh(p/k)'\n").replace("k = 4.0", "k = 4.0\na = 1.0")
    model = from_toml(text.replace("-k*p", "-a*k*p"))
    library = plugins.effects()
    found = {name: [t for t in candidates(model, library) if t.effect.id == name] for name in ("magnet", "wind")}
    assert [(t.equation, t.text, t.variable) for t in found["magnet"]] == [("v", "-a_1*exp(-p/w)", "p")]
    assert [(t.equation, t.text, t.place) for t in found["wind"]] == [("p", "+a_1*k*F*tanh(p/k)", "rate")]
    assert set(library) == set(plugins.effects())


MAGNET = """
[states]
p = "v"
v = "(F - c*v - k*p)/m"
[parameters]
m = { value = 1.0, fixed = true, unit = "kg" }
c = { value = 0.4, sd = 0.02, unit = "N*s/m" }
k = { value = 4.0, sd = 0.2, unit = "N/m" }
s = { value = 0.8, fixed = true, unit = "m" }
[inputs]
F = "force"
[outputs]
pos = "p"
[initial]
p = 0.0
v = 0.0
[units]
t = "s"
p = "m"
v = "m/s"
F = "N"
[[effects]]
id = "magnet"
term = "-a*exp(-((p - s)/w)**2)"
equation = "v"
sentence = "A magnet pulls beside the rail."
sign = 1
inner = { w = { of = "spread", start = 0.1, low = 0.01, high = 1.0 } }
"""


def test_an_effect_of_the_models_own_that_was_removed_is_found() -> None:
    """Named among the library's, with its coefficient, its scale and their units."""
    model = from_toml(MAGNET, "plant.toml")
    truth = model.plus("v", "-a*exp(-((p - s)/w)**2)", {"a": Parameter(1.5), "w": Parameter(0.2)})
    rng = np.random.default_rng(1)
    u = np.repeat(rng.uniform(-6.0, 6.0, 40), 10)[:, None]
    x = [np.zeros(2)]
    for k in range(len(u) - 1):
        x.append(truth.step(0.05 * k, x[-1], u[k], 0.05))
    y = np.array(x)[:, :1]
    y = y + 0.01 * y.std() * rng.standard_normal(y.shape)
    names = ("cubic_stiffness", "quadratic_drag", "coulomb_friction", "sensor_bias")
    library = {name: effect for name, effect in plugins.effects().items() if name in names}
    found = diagnose(model, Record(0.05 * np.arange(len(u)), u, y), library)
    assert (found.verdict, [named.effect for named in found.effects]) == ("missing_effect", ["magnet"])
    a, w = found.effects[0].coefficients.values()
    assert abs(a.value - 1.5) < 4 * a.sd
    assert abs(w.value - 0.2) < 4 * w.sd
    assert (a.unit, w.unit) == ("m/s^2", "m")
    assert " m/s^2, w = " in found.sentence


def test_an_effect_of_the_models_own_can_be_added(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`add` finds it, writes the amended file with units, and names it where another is asked for."""
    (tmp_path / "plant.toml").write_text(MAGNET)
    assert main(["add", str(tmp_path / "plant.toml"), "magnet", "-o", str(tmp_path / "new.toml")]) == 0
    assert '+v = "(F - c*v - k*p)/m - a*exp(-((p - s)/w)**2)"' in capsys.readouterr().out
    new = read_model(tmp_path / "new.toml")
    assert (new.parameters["a"].unit, new.parameters["w"].unit) == ("m/s^2", "m")
    assert new.effects == from_toml(MAGNET).effects
    assert main(["add", str(tmp_path / "plant.toml"), "magnets", "-o", str(tmp_path / "other.toml")]) == 2
    assert "did you mean magnet?" in capsys.readouterr().err


def test_the_documented_tables_are_read() -> None:
    """The blocks of docs/model-file.md, one after the other, are a model file; no key is left undocumented."""
    text = (Path(__file__).parents[1] / "docs" / "model-file.md").read_text(encoding="utf-8")
    model = from_toml("".join(re.findall(r"```toml\n(.*?)```", text, re.DOTALL)), "plant.toml")
    assert [effect.id for effect in model.effects] == ["magnet", "creep"]
    assert all(f"| `{key}` |" in text for key in KEYS)


def test_the_variable_of_a_term_is_what_its_scale_is_of() -> None:
    """A scale stands in a bracket with what it is a scale of; without one the equation's own state comes first."""
    term = "'-a*v*F*tanh(p/w)'"
    scaled = from_toml(mine(term=term, roles="", equation="'v'"), "scaled")
    assert [(t.text, t.variable) for t in candidates(scaled, {})] == [("-a*v*F*tanh(p/w)", "p")]
    beside = from_toml(mine(term="'-a*(v + F)*tanh(p/w)'", roles="", equation="'v'"), "beside")
    assert [t.variable for t in candidates(beside, {})] == ["p"]
    plain = from_toml(mine(term="'-a*F*p'", roles="", inner="", equation="'v'"), "plain")
    assert [t.variable for t in candidates(plain, {})] == ["p"]
    own = from_toml(mine(term="'-a*F*v*p'", roles="", inner="", equation="'v'"), "own")
    assert [t.variable for t in candidates(own, {})] == ["v"]
