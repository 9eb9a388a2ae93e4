"""Two tanks in a row; the first has a second outlet, to the drain, that its model lacks."""

from suite.case import Case, Experiment, Missing
from suite.excitation import steps
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="two tanks",
    states={
        "h1": "(Q - k1*sqrt(max(h1, 0)))/A",
        "h2": "(k1*sqrt(max(h1, 0)) - k2*sqrt(max(h2, 0)))/A",
    },
    parameters={
        "A": Parameter(0.02, fixed=True, unit="m^2"),
        "k1": Parameter(4e-4, sd=2e-5, unit="m^2.5/s"),
        "k2": Parameter(5e-4, sd=2.5e-5, unit="m^2.5/s"),
    },
    inputs={"Q": Input("inflow")},
    outputs={"h1": Output("h1", column="level1"), "h2": Output("h2", column="level2")},
    initial={"h1": Initial(0.2, estimate=True), "h2": Initial(0.1, estimate=True)},
)
PLANT = DEFICIENT.plus("h1", "-a*sqrt(max(h1, 0))", {"a": Parameter(0.006)})

CASE = Case(
    name="tank-second-outlet",
    sentence="Two tanks under inflow steps, both levels measured; a leak of the first one is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(1500.0, 5.0, (0.2, 0.1), {"Q": lambda t: 2.5e-4 + steps(1e-4, 120.0)(t)}),
    missing=(Missing("outflow", "h1", {"a": 0.006}),),
    tags=("fluid",),
)
