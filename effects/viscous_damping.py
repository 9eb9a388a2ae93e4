"""Damping in proportion to speed."""

from suite.effect import Effect

EFFECT = Effect(
    id="viscous_damping",
    term="-a*v",
    roles={"v": "rate"},
    sentence="A lubricated joint or laminar flow resists in proportion to speed.",
    dimension="1/time",
    sign=1,
    family="the resistance grows with speed",
)
