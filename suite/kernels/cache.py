"""Where compiled code is kept between runs, and what happens where nothing can be kept."""

from __future__ import annotations

import os
import sys
import tempfile
import warnings
from functools import cache
from pathlib import Path
from typing import Any

# One BLAS thread a process: cells and fits run in processes of their own, and small matrices only lose by threads.
for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numba as numba  # noqa: E402  (after the thread settings, which are read at import)


@cache
def folder() -> Path | None:
    """The writable folder for compiled code ($UNMODELLED_CACHE, else the user's cache), or None with one warning."""
    named = os.environ.get("UNMODELLED_CACHE")
    base = Path(named) if named else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "unmodelled"
    try:
        base.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=base):
            pass
    except OSError as error:
        warnings.warn(
            f"compiled code cannot be kept in {base} ({error.strerror}); every start compiles anew. "
            "Set UNMODELLED_CACHE to a writable folder",
            RuntimeWarning,
            stacklevel=2,
        )
        return None
    return base


def compile_kernel(signature: Any) -> Any:
    """Decorator: compile a kernel now, for one signature, from the cache where there is one.

    Divisions by zero give inf and NaN as in numpy; the filters check for them, instead of every division.
    """
    place = folder()
    if place is None:
        return numba.njit(signature, error_model="numpy", nogil=True)
    # numba reads this at compile time: all caches of the kernels then live in one folder that can be written.
    config: Any = numba.config  # pyright: ignore[reportPrivateImportUsage]
    config.CACHE_DIR = str(place / f"numba-{numba.__version__}-{sys.implementation.cache_tag}")
    return numba.njit(signature, error_model="numpy", nogil=True, cache=True)
