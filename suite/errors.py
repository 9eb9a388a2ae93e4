"""The errors a user can cause; everything else is a defect of ours.

- InputError: what was given cannot be used; the command line exits with 2
- ModelError (an InputError): a model file or a model built in Python
- DataError (an InputError): a record: a file, a column, a value
"""

from __future__ import annotations

LONGEST = 1600  # characters of a sentence: the names of all cases fit in; the end, which says the mend, is kept


class InputError(ValueError):
    """What the user gave cannot be used: one sentence with what was expected, what came, where, and the mend.

    It quotes what was given, so it is made fit for a line of a terminal here: control characters are shown as their
    codes, and what is left of a very long quotation or list is its beginning and end.
    """

    def __init__(self, sentence: str) -> None:
        line = _shown(sentence[: LONGEST + 1])
        if len(line) > LONGEST:
            line = f"{line[: LONGEST - 125]} ... {_shown(sentence[-120:])[-120:]}"
        super().__init__(line)


def _shown(text: str) -> str:
    return "".join(char if char.isprintable() else char.encode("unicode_escape").decode("ascii") for char in text)


class ModelError(InputError):
    """A model that cannot be read or does not make sense."""


class DataError(InputError):
    """A record that cannot be read or does not fit the model."""
