"""Inputs of experiments: functions of time that a rig can play."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

Signal = Callable[[float], float]


def multisine(rms: float, low: float, high: float, lines: int, seed: int = 0) -> Signal:
    """Tones of equal size and random phase between `low` and `high` Hz; `rms` is that of their sum."""
    phases = np.random.default_rng(seed).uniform(0.0, 2 * math.pi, lines).tolist()
    tones = list(zip(np.linspace(low, high, lines).tolist(), phases, strict=True))
    size = rms * math.sqrt(2 / lines)
    return lambda t: size * sum(math.cos(2 * math.pi * f * t + phase) for f, phase in tones)


def steps(size: float, hold: float, levels: tuple[float, ...] = (1.0, 0.0, 2.0, -1.0, 0.5)) -> Signal:
    """A staircase: `size` times one level after another, each for `hold` seconds, over and over."""
    return lambda t: size * levels[int(t / hold + 1e-9) % len(levels)]
