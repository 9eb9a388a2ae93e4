"""A stirred reactor whose heat balance lacks the heat of reaction."""

from suite.case import Case, Experiment, Missing
from suite.excitation import steps
from suite.model import Initial, Input, Model, Output, Parameter

# Rate of reaction in mol/(l min), Arrhenius about 350 K.
REACTION = "k*exp(E*(1/350 - 1/T))*c"
DEFICIENT = Model(
    name="stirred reactor without heat of reaction",
    states={"c": f"q*(cf - c) - {REACTION}", "T": "q*(Tf - T) - U*(T - Tc)"},
    parameters={
        "q": Parameter(1.0, fixed=True, unit="1/min"),
        "cf": Parameter(1.0, fixed=True, unit="mol/l"),
        "Tf": Parameter(340.0, fixed=True, unit="K"),
        "k": Parameter(0.6, sd=0.06, unit="1/min"),
        "E": Parameter(6000.0, sd=300.0, unit="K"),
        "U": Parameter(2.0, sd=0.1, unit="1/min"),
    },
    inputs={"Tc": Input("coolant")},
    outputs={"c": Output("c", column="concentration"), "T": Output("T", column="temperature")},
    initial={"c": Initial(0.7, estimate=True), "T": Initial(340.0, estimate=True)},
)
PLANT = DEFICIENT.plus("T", f"+a*{REACTION}", {"a": Parameter(25.0)})

CASE = Case(
    name="reactor-heat",
    sentence="A stirred reactor under steps of its coolant, both states measured; the heat of reaction is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(30.0, 0.1, (0.7, 340.0), {"Tc": lambda t: 335.0 + steps(10.0, 3.0)(t)}),
    missing=(Missing("heat_of_reaction", "T", {"a": 25.0}),),
    tags=("thermal", "chemical", "outside"),
)
