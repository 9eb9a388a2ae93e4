"""The Van der Pol oscillator of the weak-form sparse regression, without its nonlinear damping.

The polynomials that the publication chose from hold what is missing; so does this model's own effect.
"""

from suite.case import Case, Experiment, Missing
from suite.effect import Effect
from suite.model import Initial, Model, Output, Parameter

DEFICIENT = Model(
    name="undamped oscillator",
    states={"x": "y", "y": "-k*x"},
    parameters={"k": Parameter(1.0, sd=0.05)},
    outputs={"x": Output("x", column="x"), "y": Output("y", column="y")},
    initial={"x": Initial(0.0, estimate=True), "y": Initial(1.0, estimate=True)},
    effects=(
        Effect(
            id="nonlinear_damping",
            term="+mu*(1 - x**2)*y",
            roles={},
            sentence="Small swings are driven, large ones damped: a limit cycle.",
            dimension="1/time",
            coefficients=("mu",),
            equation="y",
        ),
    ),
)
PLANT = DEFICIENT.plus("y", "+mu*(1 - x**2)*y", {"mu": Parameter(4.0)})
EXPERIMENT = Experiment(30.0, 0.01, (0.0, 1.0))

CASE = Case(
    name="van-der-pol-wsindy",
    sentence="Messenger and Bortz (2021), Van der Pol: the damping mu (1 - x^2) x' is missing; the model suspects it.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=EXPERIMENT,
    missing=(Missing("nonlinear_damping", "y", {"mu": 4.0}),),
    noises=(0.01, 0.1, 0.2, 0.4),
    tags=("mechanical", "published"),
)
