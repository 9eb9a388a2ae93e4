"""Damping that grows with the cube of speed."""

from suite.effect import Effect

EFFECT = Effect(
    id="cubic_damping",
    term="-a*v**3",
    roles={"v": "rate"},
    sentence="A resistance that grows with the cube of speed.",
    dimension="time/position^2",
    sign=1,
    family="the resistance grows faster than the speed",
    law="resistance",
)
