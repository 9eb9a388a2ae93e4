"""What a request names, opened: its model, its files, and the names that the person knows these by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from suite.discovery.excerpt import excerpt
from suite.errors import DataError, InputError
from suite.model import Model
from suite.readers import read_record
from suite.record import Record
from suite.web.lines import model_of

Files = Sequence[tuple[str, str]]  # (path, shown name)


@lru_cache(maxsize=16)
def known(source: str) -> Model:
    """The model in a text; that of the last ones is kept."""
    return model_of(source)


@lru_cache(maxsize=4)
def both(source: str, files: tuple[tuple[str, str], ...]) -> tuple[Model, Record]:
    """The model and its record, of a very long one an excerpt."""
    found = known(source)
    if not files:
        raise DataError("no data; open a file of measurements")
    if not found.outputs:
        raise InputError("the model has no outputs; add a table [outputs] that says what was measured")
    try:
        record = read_record([path for path, _ in files], found)
    except DataError as error:
        raise renamed(error, files) from None
    names = tuple(name for _, name in files)
    return found, excerpt(found, replace(record, names=names, source=", ".join(dict.fromkeys(names))))


def renamed(error: DataError, files: Files) -> DataError:
    """The error with the names that the person knows the files by."""
    sentence = str(error)
    for path, name in files:
        sentence = sentence.replace(path, name).replace(Path(path).name, name)
    return DataError(sentence)
