"""Where the measured records are: beside the checkout if they are there; tests that need them skip elsewhere."""

from __future__ import annotations

import os
from pathlib import Path

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"

# At import, so that child processes and the collection of tests see it too.
if BESIDE.is_dir():
    os.environ.setdefault("UNMODELLED_DATA", str(BESIDE))
