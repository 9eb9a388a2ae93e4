"""The model file round-trips, and every defect is one sentence."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from suite.effect import Added, Effect, Inner
from suite.errors import InputError, ModelError
from suite.model import Initial, Input, Model, Output, Parameter
from suite.model_file import from_toml, read_model, to_toml, write_model

DOCUMENTED = """
name = "driven oscillator"
time = "seconds"
[states]                        # time derivatives
p = "v"
v = "(F - c*v - k*p)/m"
[parameters]
m = { value = 1.3, fixed = true, unit = "kg" }
c = { value = 0.5, sd = 0.1, bounds = [0.0, inf] }
k = 8
q = { value = 1.0, free = true }
[inputs]
F = { column = "force", hold = "linear" }
G = "second force"
[outputs]
pos = { equation = "p", column = "position", sigma = 0.002 }
turn = { equation = "p/q", angle = true }
speed = "v + 0*G"
[initial]
p = 0.0
v = { value = 0.1, estimate = true }
[suspect]
equations = ["v"]
[units]
t = "s"
p = "m"
[[effects]]
id = "magnet"
term = "-a*exp(-p/w)"
roles = { p = "position", v = "rate" }
sentence = "A magnet pulls near the wall."
sign = 1
inner = { w = { of = "spread", start = 0.1, low = 0.01, high = 1.0 } }
[[effects]]
id = "lagging_drag"
term = "b*c*z"
equation = "v"
coefficients = ["b"]
inner = { w = { of = "time", start = 0.1, low = 0.01, high = 1, tries = [1, 10] } }
states = { z = { rate = "(v - z)/w", start = "v", free = true } }
"""


def test_the_documented_file_means_what_is_documented() -> None:
    """Short and long forms give the same nouns, with the stated defaults."""
    model = from_toml(DOCUMENTED, "plant.toml")
    assert model.name == "driven oscillator"
    assert model.time == "seconds"
    assert model.parameters == {
        "m": Parameter(1.3, fixed=True, unit="kg"),
        "c": Parameter(0.5, sd=0.1, bounds=(0.0, math.inf)),
        "k": Parameter(8.0),
        "q": Parameter(1.0, free=True),
    }
    assert model.inputs == {"F": Input("force", "linear"), "G": Input("second force", "previous")}
    assert model.outputs == {
        "pos": Output("p", "position", sigma=0.002),
        "turn": Output("p/q", "turn", angle=True),
        "speed": Output("v + 0*G", "speed"),
    }
    assert model.initial == {"p": Initial(0.0), "v": Initial(0.1, estimate=True)}
    assert model.suspects == ("v",)
    assert model.units == {"t": "s", "p": "m"}
    assert model.effects == (
        Effect(
            id="magnet",
            term="-a*exp(-p/w)",
            roles={"p": "position", "v": "rate"},
            sentence="A magnet pulls near the wall.",
            dimension="",
            sign=1,
            inner={"w": Inner("spread", 0.1, 0.01, 1.0)},
        ),
        Effect(
            id="lagging_drag",
            term="+b*c*z",
            roles={},
            sentence="",
            dimension="",
            coefficients=("b",),
            inner={"w": Inner("time", 0.1, 0.01, 1.0, (1.0, 10.0))},
            states={"z": Added("(v - z)/w", "v", free=True)},
            equation="v",
        ),
    )


def test_a_file_written_is_the_model_read(tmp_path: Path) -> None:
    """File -> Model -> file -> Model loses nothing, and writes no temporary file beside it."""
    model = from_toml(DOCUMENTED, "plant.toml")
    path = tmp_path / "new folder" / "plant.toml"
    write_model(model, path)
    assert read_model(path) == model
    assert [file.name for file in path.parent.iterdir()] == ["plant.toml"]
    assert to_toml(read_model(path)) == path.read_text(encoding="utf-8")


TEXT = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=20).filter(lambda text: text.strip())
NUMBER = st.floats(allow_nan=False, allow_infinity=False)
POSITIVE = st.floats(5e-324, 1e300)
UNIT = st.sampled_from(["1", "m", "kg m^2", "N*s/m", "1/m^2/s^2", "degC", "%", "m^0.5/s", "µm"])
PARAMETER = st.builds(Parameter, value=NUMBER, sd=st.none() | POSITIVE, fixed=st.booleans(), unit=st.none() | UNIT)
INPUT = st.builds(Input, column=TEXT, hold=st.sampled_from(["previous", "linear"]))
OUTPUT = st.builds(Output, equation=st.just("x*a + u"), column=TEXT, sigma=st.none() | POSITIVE, angle=st.booleans())
SCALE = st.builds(
    Inner,
    of=st.sampled_from(["spread", "range", "frequency", "time", "step", "one"]),
    start=st.floats(1.0, 2.0),
    low=st.floats(0.1, 1.0),
    high=st.floats(3.0, 1e300),
    tries=st.just((1.0, 0.3, 3.0)) | st.lists(POSITIVE, min_size=1, max_size=3).map(tuple),
)
ADDED = st.builds(
    Added, rate=st.sampled_from(["(x - z)/w", "x*t"]), start=st.just("0") | st.just("x"), free=st.booleans()
)
WORDS = st.just("") | TEXT
EFFECT = st.builds(
    Effect,
    id=st.from_regex(r"[a-z]{1,9}_of_mine", fullmatch=True),
    term=st.just("-b*(x*exp(-t/w) + z)"),
    roles=st.just({}),
    equation=st.sampled_from(["x", "u", "out put"]),
    sentence=WORDS,
    dimension=WORDS,
    coefficients=st.just(("b",)),
    sign=st.sampled_from([0, 1]),
    inner=st.builds(lambda scale: {"w": scale}, SCALE),
    states=st.builds(lambda state: {"z": state}, ADDED),
    forms=st.just(()) | st.just(("+b*x/w", "-b*z")),
    pinned=st.booleans(),
    family=WORDS,
    generic=st.booleans(),
) | st.builds(
    Effect,
    id=st.from_regex(r"[a-z]{1,9}_of_yours", fullmatch=True),
    term=st.just("-a*y"),
    roles=st.sampled_from(
        [{"y": "any"}, {"y": "output"}, {"y": "level", "q": "temperature"}, {"y": "held", "q": "input"}]
    ),
    sentence=WORDS,
    dimension=WORDS,
)
EFFECTS = st.lists(EFFECT, max_size=3, unique_by=lambda effect: effect.id).map(tuple)
UNITS = st.dictionaries(st.sampled_from(["u", "t"]), UNIT)


@settings(max_examples=80, deadline=None)
@given(
    TEXT, PARAMETER, INPUT, OUTPUT, st.none() | TEXT, st.none() | st.just(()) | st.just(("x",)), NUMBER, UNITS, EFFECTS
)
def test_every_model_round_trips(
    name: str,
    parameter: Parameter,
    entry: Input,
    output: Output,
    time: str | None,
    suspect: tuple[str, ...] | None,
    start: float,
    units: dict[str, str],
    effects: tuple[Effect, ...],
) -> None:
    """Any names, units, columns and effects, any finite number to its last digit."""
    model = Model(
        name=name,
        states={"x": "-a*x + u"},
        parameters={"a": parameter},
        inputs={"u": entry},
        outputs={"out put": output},
        initial={"x": Initial(start)},
        suspect=suspect,
        time=time,
        units=units,
        effects=effects,
    )
    assert from_toml(to_toml(model)) == model


STATES = '[states]\nx = "-k*x"\n'
DEFECTS = {
    "no number": (
        STATES + "[parameters]\nk = 'abc'",
        "plant.toml, [parameters] k: expected a number, got 'abc'; write k = 1.3",
    ),
    "a flag for a number": (STATES + "[parameters]\nk = true", "[parameters] k: expected a number, got true"),
    "a date": (STATES + "[parameters]\nk = 2020-01-01", "[parameters] k: expected a number"),
    "not finite": (STATES + "[parameters]\nk = inf", "[parameters] k: expected a finite number, got inf"),
    "nan": (STATES + "[parameters]\nk = {value = nan}", "[parameters] k: expected a finite number, got nan"),
    "huge": (STATES + "[parameters]\nk = 1" + "0" * 400, "[parameters] k: expected a finite number, got inf"),
    "endless": (STATES + "[parameters]\nk = 1" + "0" * 5000, "not valid TOML"),
    "no value": (STATES + "[parameters]\nk = {sd = 1.0}", "[parameters] k: no value; write k = { value = 1.3 }"),
    "misspelt key": (STATES + "[parameters]\nk = {valu = 1.0}", "'valu' is not known here (did you mean value?)"),
    "sd of zero": (STATES + "[parameters]\nk = {value = 1, sd = 0}", "[parameters] k: sd is 0"),
    "contradiction": (STATES + "[parameters]\nk = {value = 1, sd = 1, free = true}", "contradict each other"),
    "flag as text": (STATES + "[parameters]\nk = {value = 1, fixed = 'yes'}", "fixed is 'yes', expected true or false"),
    "bounds": (STATES + "[parameters]\nk = {value = 1, bounds = [2]}", "expected bounds = [low, high]"),
    "empty bounds": (STATES + "[parameters]\nk = {value = 1, bounds = [2, 1]}", "bounds [2, 1] hold nothing"),
    "outside": (STATES + "[parameters]\nk = {value = 1, bounds = [2, 3]}", "the value 1 is outside its bounds [2, 3]"),
    "misspelt table": (STATES + "[parameter]\nk = 1", "'parameter' is not known here (did you mean parameters?)"),
    "unknown table": (STATES + "[colours]\nk = 1", "known are name, time, states, parameters"),
    "not a table": ("states = 3", "[states]: expected a table, got 3"),
    "rate as number": ("[states]\nx = 0", '[states] x: expected text in quotes, got 0; write x = "-k*x"'),
    "no states": ("[parameters]\nk = 1", "no states"),
    "nothing declared": (STATES, "[states] x: 'k' is not declared"),
    "hold": (
        STATES + "[parameters]\nk=1\n[inputs]\nu = {column='u', hold='cubic'}",
        "hold is 'cubic'; write hold = \"previous\"",
    ),
    "hold as list": (STATES + "[parameters]\nk=1\n[inputs]\nu = {column='u', hold=[1]}", "hold is a list"),
    "no equation": (STATES + "[parameters]\nk=1\n[outputs]\ny = {column='y'}", "[outputs] y: no equation"),
    "sigma": (STATES + "[parameters]\nk=1\n[outputs]\ny = {equation='x', sigma=-1}", "sigma is -1"),
    "start": (STATES + "[parameters]\nk=1\n[initial]\nx = {estimate=true}", "[initial] x: no value"),
    "suspect": (
        STATES + "[parameters]\nk=1\n[suspect]\nequations = 'x'",
        "[suspect]: expected a list of states, got 'x'",
    ),
    "name": ("name = 3\n" + STATES, 'name: expected text in quotes, got 3; write name = "driven oscillator"'),
    "syntax": ("[states]\nx = -k*x", "line 2"),
    "twice": ("[states]\nx = '0'\nx = '1'", "not valid TOML: cannot overwrite a value"),
    "deep": ("x = " + "[" * 50_000, "not valid TOML"),
    "a unit of nothing": (
        STATES + "[parameters]\nk=1\n[units]\nq = 'm'",
        "[units] q: neither a state nor an input nor t",
    ),
    "a unit as number": (STATES + "[parameters]\nk=1\n[units]\nx = 1", "[units] x: expected text in quotes, got 1"),
    "a unit that is none": (STATES + "[parameters]\nk=1\n[units]\nx = 'Volt'", "[units] x: 'Volt' is no unit"),
    "a parameter's unit that is none": (STATES + "[parameters]\nk={value=1, unit='n/a'}", "k unit: 'n/a' is no unit"),
    "unlike units": (
        STATES + "[parameters]\nk={value=1, unit='1/min'}\n[units]\nx='m'\nt='s'",
        "[states] x: the term k*x is in m/min, but x' is in m/s; multiply by 0.0166667, or correct a unit",
    ),
}


@pytest.mark.parametrize(("text", "sentence"), DEFECTS.values(), ids=DEFECTS.keys())
def test_every_defect_is_one_sentence_with_its_place_and_mend(text: str, sentence: str) -> None:
    """File, table and key, what came, and what to write instead."""
    with pytest.raises(ModelError) as refusal:
        from_toml(text, "plant.toml")
    said = str(refusal.value)
    assert sentence in said
    assert said.startswith("plant.toml")
    assert ";" in said
    assert "\n" not in said


def test_files_that_are_no_model_files_are_refused(tmp_path: Path) -> None:
    """Missing, a folder, binary, empty, or far too large: each is said before anything is parsed."""
    (tmp_path / "plant.toml").write_text(STATES)
    (tmp_path / "binary.toml").write_bytes(b"\x93NUMPY\x00\xff")
    (tmp_path / "empty.toml").write_text(" \n")
    (tmp_path / "large.toml").write_text("# " + "x" * 1_000_001)
    for name, sentence in {
        "absent.toml": "no such file",
        "": "is a folder",
        "binary.toml": "not a text file",
        "empty.toml": "empty",
        "large.toml": "larger than 100 kB",
        "/dev/null": "not an ordinary file",
    }.items():
        with pytest.raises(ModelError, match=sentence):
            read_model(tmp_path / name)


def test_a_byte_order_mark_is_no_defect(tmp_path: Path) -> None:
    """Editors of another system write one."""
    path = tmp_path / "plant.toml"
    path.write_text('[states]\nx = "-x"\n', encoding="utf-8-sig")
    assert read_model(path).name == "plant"


def test_a_place_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    """A file where a folder should be ends in a sentence, not in a trace."""
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_model(from_toml('[states]\nx = "-x"\n'), tmp_path / "file" / "plant.toml")
