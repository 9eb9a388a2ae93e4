"""Bad input is answered with a sentence and its line; the sliders show the free run; the examples open."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from suite.discovery import misfit
from suite.model_file import from_toml
from suite.readers import read_record

pytest.importorskip("starlette", reason="the extra web is not installed")
pytest.importorskip("uvicorn", reason="the extra web is not installed")
pytest.importorskip("httpx", reason="the tests ask with httpx")

DECAY = Path(__file__).with_name("decay.toml").read_text(encoding="utf-8")


def _csv(rows: int = 60) -> str:
    t = np.arange(rows) * 0.1
    noise = 0.01 * np.random.default_rng(1).standard_normal(rows)
    x = np.exp(-1.2 * t) + noise
    return "t,u,x\n" + "".join(f"{a!r},0.0,{b!r}\n" for a, b in zip(t.tolist(), x.tolist(), strict=True))


def _send(client: Any, text: str, name: str = "decay.csv") -> str:
    answer = client.post("/api/data", params={"name": name}, content=text.encode())
    assert answer.status_code == 200, answer.text
    assert answer.json()["name"] == name
    return str(answer.json()["id"])


@pytest.fixture(scope="module")
def data(client: Any) -> str:
    return _send(client, _csv())


def _sentence(answer: Any, status: int) -> str:
    """The sentence of a refusal; none shows a traceback or a path of this machine."""
    assert answer.status_code == status, answer.text
    said = str(answer.json()["error"])
    assert said
    assert "Traceback" not in said
    assert "/tmp" not in said
    return said


@pytest.mark.parametrize(
    ("text", "line", "word"),
    [
        (DECAY.replace("-k*x + u", "-k*x + F"), 3, "'F' is not declared"),
        (DECAY.replace("-k*x + u", "__import__('os').system('true')"), 3, "[states] x"),
        (DECAY.replace("k = 1.0", "k = one"), 5, "TOML"),
        (DECAY.replace("k = 1.0", 'k = "one"'), 5, "expected a number"),
        (DECAY.replace("[parameters]", "[parametres]"), 4, "parameters"),
        (DECAY.replace("sigma = 0.01", "sigma = -1.0"), 9, "sigma"),
        (DECAY.replace("sigma", "sigm"), 9, "sigm"),
        (DECAY + "[initial]\ny = 1.0\n", 11, "no such state"),
        (DECAY + "[units]\nx = 'furlongs per'\n", 11, "no unit"),
        (DECAY + "[[effects]]\nid = 'pull'\nequation = 'x'\nterm = '-a*q'\ncoefficients = ['a']\n", 13, "'q'"),
        (DECAY + "x = ", 10, "TOML"),
        ("", None, "empty"),
        ("\0", None, "not a text"),
    ],
)  # fmt: skip
def test_an_error_in_the_model_names_its_line(client: Any, text: str, line: int | None, word: str) -> None:
    """The page marks the line; the sentence says what is wrong with it."""
    answer = client.post("/api/model", json={"model": text})
    assert word in _sentence(answer, 422)
    assert answer.json()["line"] == line


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "empty"),
        ("\x00\x01\x02" * 50, "decay.csv"),
        ("t,u,x\n0,0,1\n0.1,0\n0.2,0,1,4\n", "line"),
        ("t,u,x\n0,0,1\n0.1,zero,1\n", "zero"),
        ("t,u,x\n0,0,1\n0.1,0,2\n0.05,0,3\n", "line 4"),
        ("t,u,y\n0,0,1\n0.1,0,2\n", "no column 'x'"),
    ],
)
def test_a_bad_table_is_refused_by_the_name_it_has(client: Any, text: str, word: str) -> None:
    """When it comes in, or when the model asks it for its columns."""
    answer = client.post("/api/data?name=decay.csv", content=text.encode())
    if answer.status_code == 200:
        answer = client.post("/api/compare", json={"model": DECAY, "data": [answer.json()["id"]]})
    said = _sentence(answer, 400 if not text else 422)
    assert word in said
    assert "decay.csv" in said


@pytest.mark.parametrize(
    "body", [b"", b"[", b"[]", b"7", b'{"model": 1}', b'{"model": null}', b"[" * 100_000, b'{"model": "a"', b"\xff\xfe"]
)
def test_a_body_that_is_no_request_is_refused(client: Any, body: bytes) -> None:
    """Whatever is posted, the answer is a sentence."""
    for path in ("/api/model", "/api/compare", "/api/simulate", "/api/values", "/api/analyse", "/api/report"):
        _sentence(client.post(path, content=body), 400)


@pytest.mark.parametrize("value", ["1", None, True, math.nan, math.inf, 10**400])
def test_a_value_that_is_no_number_is_refused(client: Any, data: str, value: Any) -> None:
    """Sliders send finite numbers."""
    body = json.dumps({"model": DECAY, "data": [data], "values": {"k": value}})
    for path in ("/api/simulate", "/api/values"):
        assert "finite numbers" in _sentence(client.post(path, content=body.encode()), 400)
    unknown = client.post("/api/values", json={"model": DECAY, "values": {"c": 1.0}})
    assert "it has k" in _sentence(unknown, 422)


def test_kept_values_are_the_same_model_elsewhere(client: Any) -> None:
    """Keep changes the start values and nothing that is known about them."""
    text = DECAY.replace("k = 1.0", "k = { value = 1.0, sd = 0.2, bounds = [0.0, 2.0] }")
    answer = client.post("/api/values", json={"model": text, "values": {"k": 1.5}})
    assert from_toml(answer.json()["model"]) == from_toml(text).with_values({"k": 1.5})
    beyond = client.post("/api/values", json={"model": text, "values": {"k": 2.5}})
    assert "from 0 to 2" in _sentence(beyond, 422)


@pytest.mark.parametrize("initial", ["", "[initial]\nx = 1.0\n", "[initial]\nx = { value = 0.8, estimate = true }\n"])
def test_the_sliders_show_the_free_run(client: Any, data: str, tmp_path: Path, initial: str) -> None:
    """A simulation at other values is what `compare` would give for a model that has them."""
    path = tmp_path / "decay.csv"
    path.write_text(_csv())
    model = from_toml(DECAY + initial)
    for k in (1.0, 1.7, 0.4):
        body = {"model": DECAY + initial, "data": [data], "values": {"k": k}}
        [shown] = client.post("/api/simulate", json=body).json()["outputs"]
        there = model.with_values({"k": k})
        expected = misfit.compare(there, read_record(path, there))
        assert shown["y"] == pytest.approx(expected.Y[:, 0], abs=1e-4)
        assert shown["error"] == pytest.approx(expected.error["x"], rel=1e-3)
        assert shown["fit"] == pytest.approx(expected.fit["x"], abs=0.1)


def test_examples_open(client: Any) -> None:
    """Every example that the page offers has a model that can be read, and data that it can be compared with."""
    start = client.get("/api/start").json()
    examples = client.get("/api/examples").json()["examples"]
    assert start["loaded"] is None
    assert start["bench"] is False
    names = [entry["name"] for entry in examples]
    assert "paper" in names
    assert len(names) >= 5
    for name in names:
        opened = client.post("/api/example", json={"name": name}).json()
        assert opened["sentence"]
        said = client.post("/api/model", json={"model": opened["model"]}).json()
        assert said["states"]
        if name not in ("mug", "paper"):
            continue
        step = client.post(
            "/api/compare", json={"model": opened["model"], "data": [entry["id"] for entry in opened["data"]]}
        )
        assert [out["name"] for out in step.json()["outputs"]] == [out["name"] for out in said["outputs"]]
    assert "choose one of" in _sentence(client.post("/api/example", json={"name": "../silverbox"}), 422)


def test_without_a_store_there_is_no_benchmark(client: Any) -> None:
    """The sentence says how to open one."""
    for path in ("/api/bench", "/api/bench/cell?key=x"):
        assert "--store" in _sentence(client.get(path), 404)
