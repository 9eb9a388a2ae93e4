"""A simulated fleet: N machines of one kind with small logs, some of which lack what the model has no term for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

SAMPLES, STEP, FINER, NOISE = 300, 0.05, 10, 0.01
MODEL = f"""name = "shaker"
[states]
p = "v"
v = "(F - c*v - k*p)/m"
[parameters]
m = {{ value = 1.0, fixed = true, unit = "kg" }}
c = {{ value = 0.4, sd = 0.1, unit = "N*s/m" }}
k = {{ value = 4.0, sd = 0.4, unit = "N/m" }}
[inputs]
F = {{ column = "force", hold = "linear" }}
[outputs]
pos = {{ equation = "p", column = "pos", sigma = {NOISE} }}
[initial]
p = 0.0
v = 0.0
"""
# What is missing, the coefficient, and of how many machines in a hundred.
KINDS = (("", 0.0, 60), ("coulomb_friction", 0.4, 15), ("cubic_stiffness", 2.0, 15), ("quadratic_drag", 0.5, 10))


def rate(kinds: npt.NDArray[np.int64], c: Array, k: Array, force: Array, p: Array, v: Array) -> Array:
    """Acceleration of every machine, (N,), each with the effect of its kind (an index into KINDS)."""
    a = np.array([KINDS[kind][1] for kind in range(len(KINDS))])[kinds]
    missing = np.select([kinds == 1, kinds == 2, kinds == 3], [np.tanh(v / 0.01), p**3, v * np.abs(v)], 0.0)
    pull: Array = force - c * v - k * p - a * missing
    return pull


def simulate(kinds: npt.NDArray[np.int64], rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Times (SAMPLES,), forces (SAMPLES, N) and measured positions (SAMPLES, N) of machines of these kinds.

    Each machine has its own damping, stiffness and phases of the force; RK4, ten times finer than the samples.
    """
    count = len(kinds)
    c, k = 0.4 + 0.05 * rng.standard_normal(count), 4.0 + 0.2 * rng.standard_normal(count)
    phases = rng.uniform(0.0, 2 * np.pi, (2, count))
    t: Array = STEP * np.arange(SAMPLES, dtype=np.float64)
    force: Array = 2.0 * np.sin(1.7 * t[:, None] + phases[0]) + 1.2 * np.sin(0.6 * t[:, None] + phases[1])
    p, v, pos = np.zeros(count), np.zeros(count), np.zeros((SAMPLES, count))
    h = STEP / FINER
    for step in range(SAMPLES - 1):
        for part in range(FINER):
            f = [force[step] + (force[step + 1] - force[step]) * (part + at) / FINER for at in (0.0, 0.5, 1.0)]
            p1, v1 = v, rate(kinds, c, k, f[0], p, v)
            p2, v2 = v + h / 2 * v1, rate(kinds, c, k, f[1], p + h / 2 * p1, v + h / 2 * v1)
            p3, v3 = v + h / 2 * v2, rate(kinds, c, k, f[1], p + h / 2 * p2, v + h / 2 * v2)
            p4, v4 = v + h * v3, rate(kinds, c, k, f[2], p + h * p3, v + h * v3)
            p, v = p + h / 6 * (p1 + 2 * p2 + 2 * p3 + p4), v + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
        pos[step + 1] = p
    return t, force, pos + NOISE * rng.standard_normal(pos.shape)


def write(folder: Path, kinds: npt.NDArray[np.int64], seed: int) -> list[Path]:
    """Write model.toml and logs/machine-00000.csv ... of machines of these kinds; the logs."""
    (folder / "logs").mkdir(parents=True, exist_ok=True)
    (folder / "model.toml").write_text(MODEL, encoding="utf-8")
    t, force, pos = simulate(kinds, np.random.default_rng(seed))
    paths = []
    for machine in range(len(kinds)):
        lines = zip(t.tolist(), force[:, machine].tolist(), pos[:, machine].tolist(), strict=True)
        path = folder / "logs" / f"machine-{machine:05d}.csv"
        path.write_text("t,force,pos\n" + "".join(f"{a:.2f},{b:.5f},{c:.5f}\n" for a, b, c in lines), encoding="utf-8")
        paths.append(path)
    return paths


def mixed(count: int, seed: int) -> npt.NDArray[np.int64]:
    """The kinds of a fleet, drawn by their shares."""
    shares = np.array([share for *_, share in KINDS]) / 100
    return np.random.default_rng([seed, 1]).choice(len(KINDS), count, p=shares)
