"""Which files a fleet is: names, and patterns that we expand where no shell did."""

from __future__ import annotations

import glob
import os
from collections.abc import Collection, Sequence
from pathlib import Path

from suite.errors import InputError


def chosen(names: Sequence[str], ours: Collection[Path] = ()) -> dict[str, str]:
    """The real path of each file with the name that it was given, in the order given, each file once.

    A name that is no file and holds *, ? or [ is a pattern (** for folders at any depth); `ours`, which we write
    ourselves, are no match. A name of a file that is not there is kept: its row says so. InputError for a pattern
    without a match and for a folder.
    """
    own = {os.path.realpath(path) for path in ours}
    found: dict[str, str] = {}
    for name in names:
        if os.path.isdir(name):
            raise InputError(f"{name}: is a folder; with --each give files or a pattern, such as '{Path(name)}/*.csv'")
        for match in _matches(name, own) if _is_pattern(name) else [name]:
            found.setdefault(os.path.realpath(match), match)
    return found


def _is_pattern(name: str) -> bool:
    return any(sign in name for sign in "*?[") and not os.path.exists(name)


def _matches(name: str, own: Collection[str]) -> list[str]:
    matches = sorted(match for match in glob.glob(name, recursive=True) if not os.path.isdir(match))
    matches = [match for match in matches if os.path.realpath(match) not in own]
    if not matches:
        raise InputError(f"no file is like {name!r}; check the pattern, and quote it so that the shell leaves it alone")
    return matches
