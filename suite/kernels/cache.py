"""Where compiled code is kept between runs, and what happens where nothing can be kept."""

from __future__ import annotations

import hashlib
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
    try:
        base = Path(named) if named else Path(os.environ.get("XDG_CACHE_HOME") or _home() / ".cache") / "unmodelled"
    except RuntimeError:
        # A user without a home, as in some containers.
        _cannot_be_kept("the user's cache", "the user has no home")
        return None
    try:
        base.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=base):
            pass
    except OSError as error:
        _cannot_be_kept(base, error.strerror)
        return None
    return base


def _home() -> Path:
    """The user's home; RuntimeError where there is none. Python takes an empty HOME for the root folder."""
    if os.environ.get("HOME") == "":
        raise RuntimeError("HOME is empty")
    return Path.home()


@cache
def _cannot_be_kept(base: Path | str, reason: str) -> None:
    """Say so, once."""
    warnings.warn(
        f"compiled code cannot be kept in {base} ({reason}); every start compiles anew. "
        "Set UNMODELLED_CACHE to a writable folder",
        RuntimeWarning,
        stacklevel=3,
    )


@cache
def _version() -> str:
    """A hash of the kernels' files: what a kernel calls is compiled into it, and numba looks at its own file alone."""
    code = (path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
    return hashlib.sha256(b"".join(code)).hexdigest()[:8]


def compile_kernel(signature: Any) -> Any:
    """Decorator: compile a kernel now, for one signature, from the cache where there is one.

    Divisions by zero give inf and NaN as in numpy; the filters check for them, instead of every division. A kernel
    makes no array, and its caller owns those it is given: without numba's counting of references, which is atomic, a
    step of two states takes a quarter less time.
    """
    options = {"error_model": "numpy", "nogil": True, "_nrt": False}
    place = folder()
    if place is None:
        return numba.njit(signature, **options)
    # numba reads this at compile time: all caches of the kernels then live in one folder that can be written.
    config: Any = numba.config  # pyright: ignore[reportPrivateImportUsage]
    config.CACHE_DIR = str(place / f"numba-{numba.__version__}-{sys.implementation.cache_tag}-{_version()}")

    def compiled(function: Any) -> Any:
        try:
            return numba.njit(signature, cache=True, **options)(function)
        except OSError as error:
            # The disk is full: that costs time, not the command.
            _cannot_be_kept(place, error.strerror)
            return numba.njit(signature, **options)(function)

    return compiled
