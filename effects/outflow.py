"""A leak or a second outlet."""

from suite.effect import Effect

EFFECT = Effect(
    id="outflow",
    term="-a*sqrt(max(x, 0))",
    roles={"x": "content"},
    sentence="A vessel loses through an opening with the square root of its level (Torricelli).",
    dimension="state^0.5/time",
    sign=1,
    family="the loss grows more slowly than proportionally",
    law="loss",
)
