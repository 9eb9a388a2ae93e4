"""The JSON body of a request, each value taken with its kind checked."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

from starlette.requests import Request

from suite.web.jobs import RefusedError

MANY = 1000  # entries of a list or a table


@dataclass(frozen=True)
class Asked:
    """A request's object."""

    body: dict[str, Any]

    def text(self, key: str) -> str:
        """A text."""
        value = self.body.get(key)
        if not isinstance(value, str):
            raise _wrong(key, "a text")
        return value

    def names(self, key: str) -> list[str]:
        """A list of texts."""
        value = self.body.get(key)
        if not isinstance(value, list) or len(value) > MANY or not all(isinstance(item, str) for item in value):
            raise _wrong(key, "a list of texts")
        return value

    def numbers(self, key: str) -> dict[str, float]:
        """Finite numbers by name."""
        value = self.body.get(key)
        if not isinstance(value, dict) or len(value) > MANY:
            raise _wrong(key, "an object of numbers")
        return {name: _number(key, number) for name, number in value.items()}

    def flag(self, key: str) -> bool:
        """True or false; false where left out."""
        value = self.body.get(key, False)
        if not isinstance(value, bool):
            raise _wrong(key, "true or false")
        return value


def _number(key: str, value: Any) -> float:
    try:
        number = float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise _wrong(key, "an object of finite numbers")
    return number


async def asked(request: Request) -> Asked:
    """The body of a request; refuses what is no JSON object."""
    try:
        body = json.loads(await request.body())
    except (ValueError, RecursionError):
        body = None
    if not isinstance(body, dict):
        raise RefusedError("expected a JSON object as the body", status=400)
    return Asked(body)


def _wrong(key: str, wanted: str) -> RefusedError:
    return RefusedError(f"{key}: expected {wanted}", status=400)
