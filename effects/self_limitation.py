"""Crowding."""

from suite.effect import Effect

EFFECT = Effect(
    id="self_limitation",
    term="-a*x**2",
    roles={"x": "content"},
    sentence="Growth limits itself: crowding, saturation of a resource.",
    dimension="1/(state time)",
    sign=1,
    family="the loss grows faster than proportionally",
    law="loss",
)
