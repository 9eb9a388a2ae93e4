"""The contract of an effect: a physical term that a model may lack, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Role = Literal["position", "rate", "state", "other", "temperature", "deviation", "time"]


@dataclass(frozen=True)
class Inner:
    """An inner scale of a term (a width, a frequency): its start and its range, in multiples of `of`.

    `of` is "spread" (of the visited range of the term's variable), "frequency" (2 pi over the record's length) or
    "one" (a pure number).
    """

    of: Literal["spread", "frequency", "one"]
    start: float
    low: float
    high: float


@dataclass(frozen=True)
class Effect:
    """One missing effect.

    `term` is text in role letters (keys of `roles`), coefficients and inner scales; it opens with its sign, so that a
    positive coefficient is the physical one. Roles: "position" and "rate" are a pair p' = v with the effect in v';
    "state" is the state in whose equation it acts; "other" another state; "deviation" the state minus the level that
    its equation relaxes to (itself where there is none); "temperature" an absolute temperature, "level" its ambient.
    `sign` is 1 for a coefficient that cannot be negative (a loss), 0 for either sign. `dimension` is the
    coefficient's, in words of the roles. `family` is what this term shares with its look-alikes, as a clause that
    completes "in each of them ...". `generic` effects stand in for a shape, not for physics: they are offered
    where no effect with a mechanical role is.
    """

    id: str
    term: str
    roles: Mapping[str, str]
    sentence: str
    dimension: str
    coefficients: tuple[str, ...] = ("a",)
    sign: Literal[0, 1] = 0
    inner: Mapping[str, Inner] = field(default_factory=dict)
    family: str = ""
    generic: bool = False
