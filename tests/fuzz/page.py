"""The page's addresses: every route, method, header and kind of body, asked of a real server in its own process."""

from __future__ import annotations

import http.client
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from csv_file import files as tables
from hypothesis import strategies as st
from model import PLANT
from model import files as models
from mutations import values, words
from oracle import WAIT, Oracle

from suite.web.routes import ROUTES

SLOW = (
    "/api/analyse",
    "/api/compare",
    "/api/simulate",
    "/api/example",
    "/api/examples",
    "/api/report",
    "/api/bench/cell",
)
PATHS = (
    *(route.path for route in ROUTES),
    "/static/index.html",
    "/static/../app.py",
    "/static/%2e%2e/app.py",
    "/api",
    "//",
)
FOREIGN = ("null", "http://evil.example", "*")
# Bodies that no sampling of values makes: deep, with numbers that JSON has not, with one key twice, too large.
BODIES = (
    b"[" * 200_000,
    b'{"model":' * 100_000,
    b'{"model": "", "data": ["x"], "values": {"c": NaN, "k": Infinity}}',
    b'{"model": "", "model": 1, "data": "../../etc/passwd"}',
    b'{"values": {"c": ' + b"9" * 100_000 + b"}}",
    b'"\\ud800"',
    b"\xff\xfe{",
    b"#" * 1_100_000,
    b"t,u,y\n" + b"0,1,2" * 250_000,
)
KEYS = ("model", "data", "values", "absolute", "name", "analyses")
latin = st.text(st.characters(max_codepoint=255, blacklist_characters="\r\n\0"), max_size=30)
headers = st.dictionaries(
    st.sampled_from(
        ["content-type", "accept", "range", "if-none-match", "expect", "cookie", "origin", "host", "x", "te"]
    ),
    st.one_of(
        latin,
        st.sampled_from([*FOREIGN, "bytes=0-0,9-1", "application/json", "100-continue", ""]),
    ),
    max_size=2,
)


@st.composite
def requests(draw: st.DrawFn) -> tuple[str, str, dict[str, str], bytes]:
    method = draw(st.sampled_from(["GET", "POST", "POST", "POST", "HEAD", "PUT", "DELETE", "OPTIONS", "TRACE", "X"]))
    path = draw(st.sampled_from(PATHS))
    name = draw(st.one_of(st.sampled_from(["a.csv", "a.parquet", "a.mat", "../a.csv", ""]), words))
    query = "".join(
        c if c.isalnum() or c in "./" else f"%{b:02x}" for c in name[:50] for b in c.encode("utf-8", "replace")[:1]
    )
    path += draw(st.sampled_from(["", f"?name={query}", f"?key={query}", f"?token={query}", f"/{query}"]))
    fields = st.fixed_dictionaries(
        {}, optional={key: st.one_of(values, words, st.lists(words, max_size=2)) for key in KEYS}
    )
    sound = models().map(lambda text: {"model": text.decode("utf-8", "replace")[:20_000], "data": [], "values": {}})
    plain = st.one_of(fields, sound, st.just({"model": PLANT, "values": {"c": 1e400}, "data": ["x"]}))
    plain = st.one_of(plain, st.just({"name": "../../etc/passwd", "data": ["/etc/passwd"], "model": PLANT}))
    body = st.one_of(
        st.sampled_from(BODIES),
        plain.map(lambda thing: json.dumps(thing, default=str).encode()),
        tables(),
        st.binary(max_size=60),
    )
    return method, path, draw(headers), draw(body)


strategy = requests()


def _spent(process: int) -> float:
    """Processor seconds of a process and all below it."""
    total = 0.0
    try:
        parts = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        total = (int(parts[11]) + int(parts[12])) / os.sysconf("SC_CLK_TCK")
        for task in Path(f"/proc/{process}/task").iterdir():
            total += sum(map(_spent, map(int, (task / "children").read_text().split())))
    except (OSError, IndexError):
        pass
    return total


def prepare(oracle: Oracle, folder: Path) -> Any:
    """A server of the page, and a cookie of it."""
    said, home = (folder / "stderr").open("w+"), folder / "home"
    home.mkdir()
    command = [sys.executable, "-m", "suite", "serve", "--no-browser", "--port", "0"]
    server = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=said, text=True, cwd=home, env={**os.environ, "TMPDIR": str(folder)}
    )
    assert server.stdout is not None
    address, _, token = server.stdout.readline().strip().partition("/?token=")
    port = int(address.rpartition(":")[2])

    def ask(method: str, path: str, sent: dict[str, str], body: bytes) -> tuple[int, bytes, Any]:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=WAIT)
        try:
            connection.request(method, path, body, sent)
            answer = connection.getresponse()
            return answer.status, answer.read(), answer.getheader("set-cookie")
        finally:
            connection.close()

    cookie = ask("GET", f"/?token={token}", {}, b"")[2].partition(";")[0]
    ask("GET", "/api/examples", {"cookie": cookie, "origin": address}, b"")  # everything is loaded then

    def attempt(given: tuple[str, str, dict[str, str], bytes]) -> None:
        oracle.tried += 1
        method, path, more, body = given
        before, sent = _spent(server.pid), {"origin": address, "cookie": cookie, **more}
        try:
            status, text, _ = ask(method, path, sent, body)
        except (http.client.HTTPException, OSError, ValueError) as error:
            if server.poll() is not None:
                oracle.note("the server ended", repr(given), repr(error))
            elif not isinstance(error, ConnectionError | ValueError | http.client.HTTPException):
                oracle.note("no answer", repr(given), repr(error))
            return
        spent = _spent(server.pid) - before
        oracle.answers[f"status {status}"] += 1
        if status < 300 and (sent["cookie"] != cookie or sent["origin"] in FOREIGN or "host" in sent):
            oracle.note("a stranger was answered", repr(given), str(status))
        if path.partition("?")[0] not in SLOW:
            oracle.slowest = max(oracle.slowest, spent)
            if spent > 1.5:  # what the processes load beside is counted too
                oracle.note("more than 1.5 s of processor time", repr(given), f"{spent:.1f} s")
        shown = text.decode("utf-8", "replace")
        if status >= 500 or "defect of unmodelled" in shown or "Traceback (" in shown:
            oracle.note(f"status {status} at {path.partition('?')[0]}", repr(given), shown[:300])
        # What is no HTTP the server below refuses in its own words.
        if (
            400 <= status < 500
            and shown != "Invalid HTTP request received."
            and method != "HEAD"
            and path.startswith("/api")
        ):
            try:
                json.loads(shown)["error"]
            except (ValueError, KeyError, TypeError):
                oracle.note(f"an answer {status} without a sentence", repr(given), shown[:300])

    def close() -> None:
        server.send_signal(signal.SIGINT)
        server.wait(WAIT)
        said.seek(0)
        heard = said.read()
        if any(home.iterdir()):
            oracle.note("a file where none was asked for", "", str(list(home.iterdir())))
        if "Traceback (" in heard or "failed" in heard:
            oracle.note("the server printed a failure", "", heard[-500:])

    oracle.at_end.append(close)
    return attempt
