"""Drag of a body in a turbulent flow."""

from suite.effect import Effect

EFFECT = Effect(
    id="quadratic_drag",
    term="-a*v*abs(v)",
    roles={"v": "rate"},
    sentence="Turbulent flow resists with the square of speed.",
    dimension="1/position",
    sign=1,
    family="the resistance grows with speed",
    law="resistance",
)
