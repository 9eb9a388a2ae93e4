"""What an effect adds along a typical motion: the numbers behind its picture, in no unit.

Coefficients are 1 and inner scales stand at their start, or at another of their values where that would hardly show.
States that an effect brings along are integrated along the motion by Runge and Kutta's method.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy

from suite import expressions
from suite.bracketing import TOKEN
from suite.effect import Effect

Array = npt.NDArray[np.float64]

CYCLES, SAMPLES, FINE = 6, 120, 20  # swings of a motion, samples of its record, integration steps a sample
AMBIENT, ZERO, HEATED = 20.0, 273.15, 60.0  # degrees
LEVELS = (0.0, 1.0, 0.3, -0.6, 0.8, -0.2)  # of an input that steps
ELSEWHERE = ("output", "input", "parameter", "fixed", "clock")
# Inner scales, in multiples of what they are of, that show the effect better than their starts.
SHOWN: Mapping[tuple[str, str], float] = {
    ("harmonic_forcing", "w"): float(CYCLES), ("hard_stop", "w"): 0.75, ("overflow", "w"): 0.6,
    ("sensor_saturation", "w"): 0.8,
}  # fmt: skip


@dataclass(frozen=True)
class Trace:
    """One effect along its motion; every array is (N,), N odd.

    `d` is what the term adds, `variable` what it is drawn against under the name `label`. `before` and `after` are what
    it acts on without and with it, where that is no rate. `path` is False where d follows the variable alone. `scales`
    are the inner scales that were used.
    """

    t: Array
    variable: Array
    label: str
    d: Array
    place: str
    path: bool
    scales: Mapping[str, float]
    before: Array | None = None
    after: Array | None = None


def place(effect: Effect) -> str:
    """The role that says where the effect acts, or "rate" where none of its roles does."""
    return next((role for role in effect.roles.values() if role in ELSEWHERE), "rate")


def trace(effect: Effect) -> Trace:
    """The effect along the motion that suits its roles. ModelError where its text cannot be read."""
    motion = Motion(place(effect), effect)
    letters = {letter: motion.of(role) for letter, role in effect.roles.items()}
    label, variable = _variable(effect, letters, motion)
    scales = {name: _scale(effect, name, variable, motion) for name in effect.inner}
    numbers = dict.fromkeys(effect.coefficients, 1.0) | scales
    known = {**letters, expressions.TIME: motion.t}
    known |= _integrated(effect, known, numbers, motion.t) if effect.states else {}
    d = np.broadcast_to(_function(effect.term, known, numbers)(*known.values(), *numbers.values()), motion.t.shape)
    d = np.asarray(d, dtype=np.float64)
    acting = [letter for letter in letters if np.ptp(letters[letter]) > 0 and _holds(effect.term, letter)]
    acting += [expressions.TIME] if _holds(effect.term, expressions.TIME) else []
    steady = not effect.states and acting in ([], [label])
    before, after = _both(effect, letters, d, motion)
    if motion.place == "clock":
        # Added to every rate: what this state's own rate lacks.
        d = np.gradient(letters[label], motion.t) * d
    return Trace(motion.t, variable, label, d, motion.place, not steady, scales, before, after)


def _both(effect: Effect, letters: Mapping[str, Array], d: Array, motion: Motion) -> tuple[Array | None, Array | None]:
    """What the effect acts on, without and with it; for the clock a state, which then runs as much faster."""
    if motion.place == "rate":
        return None, None
    before = next(letters[letter] for letter, role in effect.roles.items() if role == motion.place)
    if motion.place == "clock":
        return before, np.asarray(np.interp(motion.t * (1.0 + d), motion.t, before, period=motion.length))
    return before, before + d


class Motion:
    """A typical motion for a place and an effect: a swing that grows, a state that decays, an input of steps."""

    def __init__(self, place: str, effect: Effect) -> None:
        self.place = place
        roles = set(effect.roles.values())
        self.length = 2.0 * np.pi * CYCLES if place not in ("parameter", "fixed") else 1.0
        self.t = np.linspace(0.0, self.length, SAMPLES * FINE + 1)
        self.step = self.length / SAMPLES
        s = self.t / self.length
        turns = 2.0 * np.pi * CYCLES * s
        size = 0.1 + 0.9 * s
        reach = 3.0 if "angle" in roles else 1.0
        self.position = reach * size * np.sin(turns)
        self.rate = reach * (size * np.cos(turns) + 0.9 / (2.0 * np.pi * CYCLES) * np.sin(turns))
        self.steady = np.sin(turns) if place == "rate" else np.sin(0.5 * turns)
        self.decay = np.exp(-4.0 * s)
        # Contents and stores run empty, what has a level swings about it, a hot body cools.
        self.state = self.decay
        if not roles & {"content", "temperature"} and not effect.states:
            self.state = np.exp(-1.5 * s) * np.cos(4.0 * np.pi * s)
        if "temperature" in roles:
            self.state = AMBIENT + HEATED * self.decay
        self.level = AMBIENT if "temperature" in roles else 0.0
        self.slow = np.cos(np.pi * s)
        steps = np.minimum((s * len(LEVELS)).astype(int), len(LEVELS) - 1)
        self.input: Array = np.array(LEVELS)[steps]
        if "held" in roles:
            # Few samples, so that what lies between them shows.
            at = np.linspace(0.0, self.length, 4 * CYCLES + 1)
            y = np.sin(2.0 * np.pi * 2.0 * at / self.length)
            self.input = y[np.minimum((s * 4 * CYCLES).astype(int), 4 * CYCLES)]
            self.held = np.interp(self.t, at, y)
        else:
            self.held = self.input
        self.coupled = bool(roles & {"other", "another", "source"})

    def of(self, role: str) -> Array:
        """What plays a role, (N,)."""
        one = np.ones_like(self.t)
        match role:
            case "position" | "angle" | "output":
                return self.position
            case "other" | "source" | "clock":
                return self.steady
            case "rate" | "another":
                return self.rate
            case "deviation":
                return self.state - self.level
            case "temperature":
                return self.state + ZERO
            case "level":
                return (self.level + ZERO) * one
            case "input":
                return self.input
            case "held":
                return self.held
            case "late":
                # Held between samples, so that a step stays one.
                at = np.searchsorted(self.t, self.t - 1.0, side="right") - 1
                return np.asarray(self.input[np.maximum(at, 0)])
            case "parameter" | "fixed":
                return one
        return self.slow if self.coupled else self.state


def _variable(effect: Effect, letters: Mapping[str, Array], motion: Motion) -> tuple[str, Array]:
    """What the term is a function of, for the picture: another state, the position, else what of it moves; or time."""
    texts = " ".join([effect.term, *(z.rate for z in effect.states.values())])
    placed = ("position", "angle")
    seen = [letter for letter in letters if np.ptp(letters[letter]) > 0
            and (_holds(texts, letter) or effect.roles[letter] in placed)]  # fmt: skip
    order = ("other", "source", "position", "angle", "rate", "temperature", "deviation")
    for role in order:
        for letter in seen:
            if effect.roles[letter] == role:
                return letter, letters[letter]
    if not seen and _holds(texts, expressions.TIME):
        return expressions.TIME, motion.t
    letter = next(iter([*seen, *letters]), expressions.TIME)
    return letter, letters.get(letter, motion.t)


def _scale(effect: Effect, name: str, variable: Array, motion: Motion) -> float:
    """An inner scale in the units of the motion."""
    inner = effect.inner[name]
    value = SHOWN.get((effect.id, name), inner.start)
    low, high = float(variable.min()), float(variable.max())
    match inner.of:
        case "spread":
            return value * ((high - low) or 1.0)
        case "range":
            return low + value * ((high - low) or 1.0)
        case "frequency":
            return value * 2.0 * np.pi / motion.length
        case "time":
            return value * motion.length
        case "step":
            return value * motion.step
    return value


def _holds(text: str, name: str) -> bool:
    return name in TOKEN.findall(text)


def _function(
    text: str, known: Mapping[str, object], numbers: Mapping[str, float], kind: str = "numpy"
) -> Callable[..., Array]:
    """A text as a function of what is known and of the numbers, in this order."""
    names = [*known, *numbers]
    expression = expressions.parse(text, set(names) - {expressions.TIME}, f"the term {text}")
    compiled: Callable[..., Any] = sympy.lambdify([expressions.symbol(name) for name in names], expression, kind)
    return compiled


def _integrated(effect: Effect, known: Mapping[str, Array], numbers: Mapping[str, float], t: Array) -> dict[str, Array]:
    """The states that an effect brings, (N,) each: a step spans two samples, so that its middle is one of them."""
    states = list(effect.states)
    inside = {**known, **dict.fromkeys(states, t)}
    rates = [_function(effect.states[z].rate, inside, numbers, "math") for z in states]
    samples = np.column_stack(list(known.values()))
    given = list(numbers.values())
    z = np.zeros((len(t), len(states)))
    first = dict(zip(known, samples[0], strict=True))
    z[0] = [_function(effect.states[s].start, first, numbers, "math")(*samples[0], *given) for s in states]

    def rate(k: int, at: Array) -> Array:
        return np.array([f(*samples[k], *at, *given) for f in rates])

    for k in range(0, len(t) - 2, 2):
        h = float(t[k + 2] - t[k])
        k1 = rate(k, z[k])
        k2 = rate(k + 1, z[k] + 0.5 * h * k1)
        k3 = rate(k + 1, z[k] + 0.5 * h * k2)
        k4 = rate(k + 2, z[k] + h * k3)
        z[k + 2] = z[k] + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        z[k + 1] = 0.5 * (z[k] + z[k + 2])
    return {name: z[:, i] for i, name in enumerate(states)}
