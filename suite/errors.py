"""The errors a user can cause; everything else is a defect of ours.

- InputError: what was given cannot be used; the command line exits with 2
- ModelError (an InputError): a model file or a model built in Python
- DataError (an InputError): a record: a file, a column, a value
"""

from __future__ import annotations


class InputError(ValueError):
    """What the user gave cannot be used: one sentence with what was expected, what came, where, and the mend."""


class ModelError(InputError):
    """A model that cannot be read or does not make sense."""


class DataError(InputError):
    """A record that cannot be read or does not fit the model."""
