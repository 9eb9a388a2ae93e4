"""The files that docs/plugins.md shows are plug-ins under 40 lines that pass every check."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from suite.__main__ import main

PAGE = Path(__file__).parents[1] / "docs" / "plugins.md"


def test_the_files_of_the_page_pass_their_tests(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An estimator, a case and an effect, as they stand in the page."""
    if not PAGE.is_file():
        pytest.skip("the documentation is in a checkout, not beside an installed package")
    shown = re.findall(r"<!-- file: (\w+\.py) -->\n```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert [name for name, _ in shown] == ["observer.py", "tank_leak.py", "magnet.py"]
    for name, text in shown:
        assert len(text.splitlines()) < 40
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert main(["test", *(str(tmp_path / name) for name, _ in shown), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["failed"] == 0
    assert {entry["kind"] for entry in found["checks"]} == {"estimators", "cases", "effects"}
