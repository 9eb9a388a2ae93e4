"""Long work of the page streams its progress, ends when nobody waits for it, and says what the command line says."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from suite import verbs
from suite.__main__ import main

pytest.importorskip("starlette", reason="the extra web is not installed")
pytest.importorskip("uvicorn", reason="the extra web is not installed")
httpx = pytest.importorskip("httpx", reason="the tests ask with httpx")


Rounds = list[dict[str, Any]]


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """A spring that hardens as `example` writes it: model and data."""
    folder = tmp_path_factory.mktemp("plant")
    assert main(["example", "duffing", str(folder)]) == 0
    return [str(folder / "model.toml"), str(folder / "data.csv")]


@pytest.fixture(scope="module")
def served(serve: Callable[..., Any], plant: list[str]) -> Any:
    return serve(*plant)


@pytest.fixture(scope="module")
def client(served: Any) -> Iterator[Any]:
    with httpx.Client(base_url=served.origin, headers={"origin": served.origin}, timeout=120) as inside:
        assert inside.get("/", params={"token": served.token}).status_code == 303
        yield inside


@pytest.fixture(scope="module")
def loaded(client: Any) -> dict[str, Any]:
    """What the page opens with: the files named on the command line."""
    found = client.get("/api/start").json()["loaded"]
    assert [entry["name"] for entry in found["data"]] == ["data.csv"]
    return {"model": found["model"], "data": [entry["id"] for entry in found["data"]]}


def _analyse(client: Any, body: dict[str, Any]) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """All lines but the last, and the last one's result."""
    with client.stream("POST", "/api/analyse", json=body) as answer:
        assert answer.headers["content-type"].startswith("application/x-ndjson")
        lines = [json.loads(line) for line in answer.iter_lines()]
    assert "result" in lines[-1], lines[-1]
    return lines[:-1], lines[-1]["result"]


@pytest.fixture(scope="module")
def rounds(client: Any, loaded: dict[str, Any]) -> Rounds:
    """Two analyses: of the model as it is, and with the best candidate added."""
    told, first = _analyse(client, loaded)
    assert any("Trying" in line["progress"] for line in told)
    assert all(line["seconds"] >= 0 for line in told)
    _, second = _analyse(client, {**loaded, "model": first["verdict"]["candidates"][0]["start"]})
    return [first, second]


def test_two_rounds_are_what_discover_finds(client: Any, rounds: Rounds, plant: list[str], tmp_path: Path) -> None:
    """Verdict, errors, the final model and the report's ledger are those of `discover` on the same files."""
    assert main(["discover", *plant, "-o", str(tmp_path)]) == 0
    ledger = json.loads((tmp_path / "ledger.json").read_text())
    assert len(ledger["steps"]) == 2
    for found, step in zip(rounds, ledger["steps"], strict=True):
        assert found["verdict"]["verdict"] == step["verdict"]
        errors = {output["name"]: output["error"] for output in found["step"]["outputs"]}
        assert errors == pytest.approx(step["error"], rel=1e-3)
    assert (
        rounds[-1]["model"].split("[parameters]")[0] == (tmp_path / "model.toml").read_text().split("[parameters]")[0]
    )
    made = client.post("/api/report", json={"analyses": [found["id"] for found in rounds]})
    assert made.headers["content-type"].startswith("text/html")
    assert _substance(made.text) == _substance((tmp_path / "report.html").read_text())


def _substance(page: str) -> list[str]:
    """Headings and table cells of a report, numbers to two digits: fits that started apart end a little apart."""
    found = re.findall(r"<(?:h1|h2|h3|td|th)[^>]*>(.*?)</(?:h1|h2|h3|td|th)>", page, re.DOTALL)
    plain = [" ".join(re.sub(r"<[^>]+>", " ", text).split()) for text in found]
    return [re.sub(r"-?\d+\.?\d*(?:e-?\d+)?", lambda m: f"{float(m[0]):.1g}", text) for text in plain]


def test_every_number_is_finite_or_null(rounds: Rounds) -> None:
    """JSON as every browser reads it, with arrays that belong together of one length."""

    def refuse(word: str) -> None:
        raise AssertionError(word)

    for found in rounds:
        json.loads(json.dumps(found), parse_constant=refuse)
        error = found["step"]["discrepancy"]
        columns = [error["t"], error["run"], *error["d"].values(), *error["sd"].values(), *error["values"].values()]
        assert {len(column) for column in columns} == {len(error["t"])}
        assert error["variable"] == error["variables"][0]["name"] or error["variable"] in error["values"]
        for output in found["step"]["outputs"]:
            for name in ("measured", "model", "residual"):
                assert len(output[name]["t"]) == len(output[name]["y"]) > 0
        weights = [candidate["weight"] for candidate in found["verdict"]["candidates"]]
        assert sum(weights) + found["verdict"]["none"] == pytest.approx(1.0, abs=1e-6)


def test_a_candidate_brings_the_model_that_has_it(client: Any, loaded: dict[str, Any], rounds: Rounds) -> None:
    """Its text previews with the error it promises; the text to go on from keeps what the file knew."""
    best = rounds[0]["verdict"]["candidates"][0]
    assert best["effects"][0]["effect"] == "cubic_stiffness"
    assert best["removes"] > 0.5
    shown = client.post("/api/compare", json={**loaded, "model": best["model"]}).json()
    errors = {output["name"]: output["error"] for output in shown["outputs"]}
    assert errors == pytest.approx(best["error"], rel=0.02)
    before = client.post("/api/model", json={"model": loaded["model"]}).json()["parameters"]
    after = client.post("/api/model", json={"model": best["start"]}).json()["parameters"]
    assert after[: len(before)] == before


def test_the_headline_says_how_good_where_and_what(rounds: Rounds) -> None:
    """Three short sentences, before and after the effect was added."""
    before, after = (found["headline"] for found in rounds)
    assert re.match(r"The model explains \d.* % of .*\. It fails .*\. Most likely missing: cubic stiffness in ", before)
    assert "No effect is missing" in after


def _children(process: subprocess.Popen[str]) -> dict[int, float]:
    """Seconds of computing of each process that a server has started."""
    tick = os.sysconf("SC_CLK_TCK")
    fields = {}
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError):
            fields[int(entry.name)] = (entry / "stat").read_text().rpartition(")")[2].split()
    found: dict[int, float] = {}
    for _ in range(3):
        below = {process.pid, *found}
        found |= {n: (int(f[11]) + int(f[12])) / tick for n, f in fields.items() if int(f[1]) in below and f[0] != "Z"}
    return found


def _alive(process: int) -> bool:
    """Whether a process is there and has not ended."""
    try:
        return (Path("/proc") / str(process) / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the processes are watched through /proc")
def test_whoever_leaves_ends_the_work(served: Any, client: Any, loaded: dict[str, Any]) -> None:
    """When the connection closes in the middle, its process is killed at once, and the next analysis has one."""
    before = set(_children(served.process))
    with client.stream("POST", "/api/analyse", json=loaded) as answer:
        lines = answer.iter_lines()
        while "Trying" not in next(lines):
            pass
        during = _children(served.process)
    # The one that has just computed is gone.
    for _ in range(200):
        ended = set(during) - set(_children(served.process))
        if ended:
            break
        time.sleep(0.05)
    assert len(ended) == 1
    assert before & set(_children(served.process))
    _, found = _analyse(client, loaded)
    assert found["verdict"]["verdict"] == "missing_effect"


def test_two_tabs_work_at_the_same_time(client: Any, loaded: dict[str, Any]) -> None:
    """Two analyses overlap, and a comparison is answered meanwhile."""
    spans: list[tuple[float, float]] = []

    def tab() -> None:
        began = 0.0
        with client.stream("POST", "/api/analyse", json=loaded) as answer:
            for line in answer.iter_lines():
                began = began or (time.monotonic() if "Reading" in line else 0.0)
        spans.append((began, time.monotonic()))

    tabs = [threading.Thread(target=tab) for _ in range(2)]
    for thread in tabs:
        thread.start()
    assert client.post("/api/compare", json=loaded).status_code == 200
    for thread in tabs:
        thread.join()
    (a, b), (c, d) = spans
    assert max(a, c) < min(b, d)


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupt_ends_everything(tmp_path: Path, plant: list[str], stop: signal.Signals) -> None:
    """In the middle of an analysis: no traceback, no process and no file are left."""
    command = [sys.executable, "-m", "suite", "serve", *plant, "--port", "0", "--json"]
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
    assert process.stdout is not None
    url = json.loads(process.stdout.readline())["url"]
    origin = url.partition("/?")[0]
    with httpx.Client(base_url=origin, headers={"origin": origin}, timeout=60) as client:
        client.get(url)
        found = client.get("/api/start").json()["loaded"]
        body = {"model": found["model"], "data": [entry["id"] for entry in found["data"]]}
        with client.stream("POST", "/api/analyse", json=body) as answer:
            assert "progress" in next(answer.iter_lines())
            children = set(_children(process))
            process.send_signal(stop)
            out, err = process.communicate(timeout=30)
    assert process.returncode == (0 if stop == signal.SIGINT else 128 + stop)
    assert out == ""
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []
    for _ in range(200):
        if not any(_alive(child) for child in children):
            break
        time.sleep(0.05)
    assert not any(_alive(child) for child in children)
    assert all(Path(name).exists() for name in plant)


def test_a_port_that_is_taken_is_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2, and nothing is printed that looks like an address."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        assert main(["serve", "--port", str(other.getsockname()[1]), "--no-browser"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert "taken" in err


@pytest.mark.parametrize(
    "arguments", [["nothing.toml"], ["."], [sys.executable], ["--store", "no.sqlite"], ["--port", "65536"]]
)
def test_what_cannot_be_opened_is_refused_at_the_start(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2 with a sentence, before a server is started."""
    assert main(["serve", "--no-browser", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1


def test_the_aliases_of_the_page_are_those_of_the_command() -> None:
    """`example mug` and the button open the same."""
    from suite.web import example_tasks

    assert set(verbs.ALIASES) <= set(example_tasks.SHOWN)
