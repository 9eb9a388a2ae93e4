"""A small model's own step is the general one to the last digit, and is used where it may be."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from suite.expressions import parse
from suite.kernels.codegen import Gate, compile_program
from suite.kernels.integrate import workspace
from suite.kernels.step import step
from suite.kernels.unrolled import MOST_STATES
from suite.model import Initial, Input, Model, Output, Parameter

Array = npt.NDArray[np.float64]

DRIVEN = Model(
    name="driven",
    states={"p": "v", "v": "(F*cos(2*t) - c*v - k*p - b*p**3)/m"},
    parameters={"m": Parameter(1.3), "c": Parameter(0.5), "k": Parameter(8.0), "b": Parameter(3.0)},
    inputs={"F": Input("F", "linear"), "G": Input("G", "previous")},
    outputs={"pos": Output("p", "pos")},
)
ROUGH = Model(
    name="rough",
    states={"x": "-a*sign(x)*sqrt(abs(x)) + G", "w": "max(x, 0) - exp(-w)"},
    parameters={"a": Parameter(0.4)},
    inputs={"G": Input("G", "previous")},
    outputs={"x": Output("x", "x")},
)
STILL = Model(name="still", states={"x": "0", "z": "1"}, parameters={}, outputs={"x": Output("x", "x")})


def chain(masses: int) -> Model:
    """Masses between springs, n = 2 masses."""
    states: dict[str, str] = {}
    for i in range(masses):
        left, right = f"x{i - 1}" if i else "sin(t)", f"x{i + 1}" if i < masses - 1 else "0"
        states |= {f"x{i}": f"v{i}", f"v{i}": f"k*({left} - 2*x{i} + {right}) - c*v{i} - b*x{i}**3"}
    return Model(
        name=f"chain of {masses}",
        states=states,
        parameters={"k": Parameter(4.0), "c": Parameter(0.4), "b": Parameter(0.5)},
        outputs={"z": Output("x0", "z")},
        initial={name: Initial(0.0) for name in states},
    )


@pytest.mark.parametrize("model", [DRIVEN, ROUGH, STILL, chain(1), chain(3), chain(4)], ids=lambda model: model.name)
@pytest.mark.parametrize("dt", [0.0, 0.05, 1.0, 7.3])
def test_the_own_step_is_the_general_one_to_the_last_digit(model: Model, dt: float) -> None:
    """States and slopes, over one part and many, by no parameter, by all, and by some of them in any order."""
    program, n, count = model.program, len(model.states), len(model.parameters)
    own = program.step_when(program.all_off())
    assert own != 0
    rng = np.random.default_rng(3)
    for columns in ([], list(range(count)), [count - 1, 0] if count else []):
        for substeps in (1, 3):
            x0, u = rng.normal(size=n), rng.normal(size=(2, len(model.inputs)))
            found = []
            for address in (0, own):
                # What the arrays held before must not matter.
                x, T = x0.copy(), rng.normal(size=(n, n + len(columns)))
                step(
                    address, program.rate, 0.3, dt, u[0], u[1], model.linear_inputs, model.values, program.all_off(),
                    np.array(columns, dtype=np.int64), substeps, x, T,
                    workspace(n, len(model.inputs), count, len(columns)),
                )  # fmt: skip
                found.append((x, T))
            np.testing.assert_array_equal(found[0][0], found[1][0])
            np.testing.assert_array_equal(found[0][1], found[1][1])


def test_an_open_gate_leaves_the_own_step() -> None:
    """With all gates off the own step is the model alone; with one on there is none."""
    program = compile_program(
        states=("x",), inputs=(), parameters=("a", "b"), rates=[parse("-a*x", ("x", "a"), "test")],
        outputs=[parse("x", ("x",), "test")], gates=[Gate({0: parse("-b*x**3", ("x", "b"), "test")})],
    )  # fmt: skip
    off, on = program.all_off(), np.ones(1, dtype=np.int64)
    assert program.step_when(on) == 0
    none, p = np.zeros(0), np.array([0.5, 4.0])
    moved = []
    for address, gates in ((program.step_when(off), off), (0, off), (0, on)):
        x, T = np.ones(1), np.zeros((1, 3))
        step(address, program.rate, 0.0, 0.2, none, none, none, p, gates, np.arange(2), 1, x, T, workspace(1, 0, 2, 2))
        moved.append(np.append(x, T))
    np.testing.assert_array_equal(moved[0], moved[1])
    assert np.all(moved[0][[0, 1]] > moved[2][[0, 1]])
    assert moved[0][3] == 0.0


def test_a_large_model_has_no_step_of_its_own() -> None:
    """Its loops are long enough, and writing them out would cost compile time."""
    program = chain(MOST_STATES // 2 + 1).program
    assert program.step_when(program.all_off()) == 0
