"""Six masses in a row between a wall and a shaker; the wall's spring hardens."""

from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Initial, Input, Model, Output, Parameter


def chain(n: int, outputs: tuple[int, ...]) -> Model:
    """Unit masses x1 ... xn, joined by springs k, damped by c, driven at the far end, held by the wall at x1."""
    states: dict[str, str] = {}
    for i in range(1, n + 1):
        left = f"-k*(x{i} - x{i - 1})" if i > 1 else "-k*x1"
        right = f" - k*(x{i} - x{i + 1})" if i < n else " + F"
        states |= {f"x{i}": f"v{i}", f"v{i}": f"{left}{right} - c*v{i}"}
    return Model(
        name=f"chain of {n} masses",
        states=states,
        parameters={"k": Parameter(10.0, sd=0.5, unit="N/m"), "c": Parameter(0.3, sd=0.03, unit="N s/m")},
        inputs={"F": Input("force")},
        outputs={f"x{i}": Output(f"x{i}", column=f"x{i}") for i in outputs},
        initial={name: Initial(0.0) for name in states},
    )


DEFICIENT = chain(6, (2, 6))
CASE = Case(
    name="chain-small",
    sentence="Six masses in a row, shaken at one end, two measured; the hardening of the wall's spring is missing.",
    deficient=DEFICIENT,
    truth=DEFICIENT.plus("v1", "-a*x1**3", {"a": Parameter(8.0)}),
    experiment=Experiment(50.0, 0.1, (0.0,) * 12, {"F": multisine(3.0, 0.05, 0.8, 16)}),
    missing=(Missing("cubic_stiffness", "v1", {"a": 8.0}),),
    tags=("mechanical", "chain"),
)
