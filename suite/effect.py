"""The contract of an effect: a physical term that a model may lack, as data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Role = Literal[
    "position", "angle", "rate", "state", "content", "any", "other", "another", "source", "deviation", "temperature",
    "level", "output", "input", "late", "held", "parameter", "fixed", "clock",
]  # fmt: skip


@dataclass(frozen=True)
class Inner:
    """An inner scale of a term (a width, a frequency): its start and its range, in multiples of `of`.

    `of` is "spread" (the visited range of the term's variable, from zero), "range" (a place in it: 0 is its low end,
    1 its high end), "frequency" (2 pi over the record's length), "time" (the record's length), "step" (one sample) or
    "one" (a pure number). `tries` are the multiples of the start that are scored. Where low is high it is a reference
    that never moves, and is not counted.
    """

    of: Literal["spread", "range", "frequency", "time", "step", "one"]
    start: float
    low: float
    high: float
    tries: tuple[float, ...] = (1.0, 0.3, 3.0)

    @property
    def moves(self) -> bool:
        """Whether a fit may change it."""
        return self.high > self.low


@dataclass(frozen=True)
class Added:
    """A state that an effect brings along: its rate and its first value, both in the effect's letters.

    `free`: the first value is only where its estimation starts.
    """

    rate: str
    start: str = "0"
    free: bool = False


@dataclass(frozen=True)
class Effect:
    """One missing effect.

    `term` is text in role letters (keys of `roles`), coefficients, inner scales and the names of added states; it opens
    with its sign, so that a positive coefficient is the physical one. `forms` are further texts of the same effect,
    such as a stop on the other side; each is a candidate of its own. Where it acts follows from the roles:

    - in a rate: "position" and "rate" are a pair p' = v with the effect in v', "angle" a position that is an angle;
      "state" is the state in whose equation it acts, where that has no position; "content" is such a state that is no
      temperature; "any" is either; "other" another state, "another" a third one (of small models only); "source" is
      another one, whose rate loses what this one's gains, where the model already moves something between them;
      "deviation" the state minus the level that its equation relaxes to (itself where there is none); "temperature" an
      absolute temperature, "level" its ambient;
    - in a measurement: "output" is the output's own equation, to which the term is added;
    - in an input: "input" is the input, which becomes input + term wherever it acts; "late" is the input as it was one
      coefficient earlier, "held" as it is when held the other way between samples;
    - in a parameter: "parameter" becomes parameter + term wherever it stands; "fixed" is one that is said to be exact;
    - in the clock: "clock" stands for every rate, times which the term is added.

    `sign` is 1 for a coefficient that cannot be negative (a loss), 0 for either sign; `least` is another lower bound
    (a clock does not run backward). `pinned`: the coefficient is exactly 1 where the effect is there; it is scored as
    if free and not counted. `dimension` is the coefficient's, in words of the roles. `family` is what this term
    shares with its look-alikes, as a clause that completes "in each of them ...". `generic` effects stand in for a
    shape, not for physics: they are offered where no effect of the same shape is. `equation` names a state, output or
    input of one model in which the effect acts: there are no roles then, and the term is in the model's own names,
    which those of the effect's coefficients, scales and states hide. `law` names what one equation has one of: two
    bent springs in it are one spring of a shape that the library does not hold. Linear parts have none, for they go
    with any.
    """

    id: str
    term: str
    roles: Mapping[str, str]
    sentence: str
    dimension: str
    coefficients: tuple[str, ...] = ("a",)
    sign: Literal[0, 1] = 0
    inner: Mapping[str, Inner] = field(default_factory=dict)
    states: Mapping[str, Added] = field(default_factory=dict)
    forms: tuple[str, ...] = ()
    pinned: bool = False
    family: str = ""
    generic: bool = False
    law: str = ""
    least: float = -math.inf
    equation: str = ""

    @property
    def lowest(self) -> float:
        """The lower bound of the coefficients."""
        return max(0.0, self.least) if self.sign else self.least
