"""Rich displays in a notebook: `import suite.notebook` (or `%load_ext suite.notebook`) before the first cell shows one.

A Model, Record, Verdict or Ledger at the end of a cell is then a table with equations and bars instead of its repr.
"""

from __future__ import annotations

from typing import Any

from suite.discovery.result import Ledger, Verdict
from suite.model import Model
from suite.record import Record
from suite.report.rich import model_html, record_html
from suite.report.rich_findings import ledger_html, verdict_html

DISPLAYS = {Model: model_html, Record: record_html, Verdict: verdict_html, Ledger: ledger_html}


def load_ipython_extension(shell: Any) -> None:
    """Register the displays with an IPython shell."""
    for kind, display in DISPLAYS.items():
        shell.display_formatter.formatters["text/html"].for_type(kind, display)


def _register() -> None:
    """Register with the shell in which this module is imported, if it is one."""
    try:
        from IPython.core.getipython import get_ipython
    except ImportError:
        return
    shell = get_ipython()
    if shell is not None:
        load_ipython_extension(shell)


_register()
