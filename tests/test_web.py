"""Nobody but the page gets in, no path from outside is opened, and bad input is answered with a sentence."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from suite.web.jobs import RefusedError
from suite.web.uploads import Uploads

pytest.importorskip("starlette", reason="the extra web is not installed")
pytest.importorskip("uvicorn", reason="the extra web is not installed")
httpx = pytest.importorskip("httpx", reason="the tests ask with httpx")

DECAY = Path(__file__).with_name("decay.toml").read_text(encoding="utf-8")


def _files(served: Any) -> list[Path]:
    """What the server holds on the disk."""
    return sorted(path for path in served.folder.rglob("*") if path.is_file())


def _sentence(answer: Any, status: int) -> str:
    """The sentence of a refusal; none shows a traceback or a path of this machine."""
    assert answer.status_code == status, answer.text
    said = str(answer.json()["error"])
    assert said
    assert "Traceback" not in said
    assert "/tmp" not in said
    return said


@pytest.mark.parametrize("host", ["evil.example", "evil.example:{port}", "127.0.0.1", "localhost:1", "0.0.0.0:{port}"])
def test_a_foreign_host_is_refused_everywhere(client: Any, host: str) -> None:
    """A page whose name is made to point here (DNS rebinding) gets nothing, not even the page's files."""
    for path in ("/", "/api/start", "/static/index.html"):
        answer = client.get(path, headers={"host": host.format(port=client.base_url.port)})
        assert "only" in _sentence(answer, 403)


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:1", "https://127.0.0.1:{port}", ""]
)
def test_a_foreign_origin_is_refused(client: Any, origin: str) -> None:
    """Another page cannot ask in the user's name, nor can one on another port of this machine."""
    headers = {"origin": origin.format(port=client.base_url.port)}
    assert "Origin" in _sentence(client.post("/api/model", json={"model": DECAY}, headers=headers), 403)


def test_a_request_without_origin_changes_nothing(served: Any, client: Any) -> None:
    """A form or a plain program that sends no Origin is refused where something is posted."""
    with httpx.Client(base_url=served.origin, cookies=dict(client.cookies)) as bare:
        assert "None" in _sentence(bare.post("/api/model", json={"model": DECAY}), 403)


def test_without_the_cookie_nothing_is_answered(served: Any, client: Any) -> None:
    """Whoever has no token has no page; a wrong one opens nothing; the right one is left out of the address."""
    wrong = {name: "x" * len(value) for name, value in client.cookies.items()}
    assert len(wrong) == 1
    for cookies in ({}, wrong):
        with httpx.Client(base_url=served.origin, headers={"origin": served.origin}, cookies=cookies) as stranger:
            for path in ("/api/start", "/static/index.html", "/api/nothing"):
                assert "cookie" in _sentence(stranger.get(path), 403)
            assert "cookie" in _sentence(stranger.post("/api/model", json={"model": DECAY}), 403)
            assert stranger.get("/").status_code == stranger.get("/?token=wrong").status_code == 403
    opened = httpx.get(served.url)
    assert (opened.status_code, opened.headers["location"]) == (303, "/")
    assert {"httponly", "samesite=strict"} <= {part.strip().lower() for part in opened.headers["set-cookie"].split(";")}


@pytest.mark.parametrize("path", ["/", "/api/start", "/api/nothing", "/static/index.html", "/static/nothing"])
def test_every_answer_forbids_the_browser_everything_else(client: Any, path: str) -> None:
    """Errors too: no script, style, frame or connection but the server's own."""
    headers = client.get(path).headers
    policy = dict(part.strip().split(" ", 1) for part in headers["content-security-policy"].split(";"))
    assert policy["default-src"] == policy["form-action"] == policy["frame-ancestors"] == policy["base-uri"] == "'none'"
    assert policy["script-src"] == policy["connect-src"] == policy["style-src"] == "'self'"
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cross-origin-resource-policy"] == headers["cross-origin-opener-policy"] == "same-origin"
    assert ("no-store" in headers["cache-control"]) == (not path.startswith("/static"))


@pytest.mark.parametrize("path", ["/static/../desk.py", "/static/%2e%2e/desk.py", "/static/..%2fdesk.py", "//etc/x"])
def test_static_files_are_those_of_the_page(client: Any, path: str) -> None:
    """No way leads out of the folder."""
    # Sent as it stands: a client would tidy the path up.
    connection = http.client.HTTPConnection(client.base_url.host, client.base_url.port)
    [(name, value)] = client.cookies.items()
    connection.request("GET", path, headers={"Cookie": f"{name}={value}"})
    assert connection.getresponse().status == 404
    connection.close()


def _endless(sent: list[int]) -> Iterator[bytes]:
    """Bytes for as long as somebody takes them, a hundred times the limit at most; counts the pieces."""
    for _ in range(1600):
        sent[0] += 1
        yield b"1.0,2.0\n" * 8192


def test_a_body_over_the_limit_is_refused_as_it_streams(served: Any, client: Any) -> None:
    """With or without a stated length; the server takes little more than the limit, and keeps nothing of it."""
    before = _files(served)
    assert "1 MB" in _sentence(client.post("/api/model", content=b"#" * 1_100_000), 413)
    assert "1 MB" in _sentence(client.post("/api/model", content=iter([b"#" * 100_000] * 11)), 413)
    sent = [0]
    with contextlib.suppress(httpx.TransportError):
        assert client.post("/api/model", content=_endless(sent)).status_code == 413
    assert sent[0] < 200
    assert _files(served) == before


@pytest.mark.parametrize(
    "name",
    [
        "../../etc/passwd",
        "/etc/passwd.csv",
        "..\\x.csv",
        "a\0.csv",
        "x" * 10_000 + ".csv",
        "",
        ".csv",
        "model.toml",
        "a.csv.exe",
        "a\n.csv",
    ],
)
def test_a_name_opens_nothing(served: Any, client: Any, name: str) -> None:
    """A name that is a path, has control characters or is endless is refused, and no file is written anywhere."""
    before = _files(served)
    said = _sentence(client.post("/api/data", params={"name": name}, content=b"t,x\n0,1\n1,2\n"), 400)
    assert len(said) < 300
    assert _files(served) == before


@pytest.mark.parametrize("identity", ["../../etc/passwd", "/etc/passwd", "\0", "x" * 10_000, ""])
def test_an_id_that_the_server_did_not_give_opens_nothing(client: Any, identity: str) -> None:
    """Data are named by ids alone."""
    for path in ("/api/compare", "/api/analyse"):
        assert "open them again" in _sentence(client.post(path, json={"model": DECAY, "data": [identity]}), 422)
    assert "analyse again" in _sentence(client.post("/api/report", json={"analyses": [identity]}), 422)


def test_a_data_file_over_the_limit_is_not_kept(tmp_path: Path) -> None:
    """What was written of it before the limit was reached is removed."""

    async def chunks() -> Any:
        for _ in range(3):
            yield b"1,2\n" * 100

    async def break_off() -> Any:
        yield b"1,2\n"
        raise RefusedError("more than 3 MB were sent", status=413)

    uploads = Uploads()
    try:
        kept = asyncio.run(uploads.take("a.csv", chunks()))
        assert kept.path.read_bytes() == b"1,2\n" * 300
        with pytest.raises(RefusedError):
            asyncio.run(uploads.take("b.csv", break_off()))
        assert [path.name for path in uploads.folder.iterdir()] == [kept.path.name]
        assert "a.csv" not in kept.path.name
    finally:
        uploads.close()
    assert not uploads.folder.exists()
