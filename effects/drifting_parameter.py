"""A number that drifts."""

from suite.effect import Effect

EFFECT = Effect(
    id="drifting_parameter",
    term="+a*t",
    roles={"k": "parameter"},
    sentence="A number that the model takes for constant drifts: wear, heating, fouling, an emptying tank.",
    dimension="parameter/time",
    family="the plant changes with time",
)
