"""Dry friction."""

from suite.effect import Effect, Inner

EFFECT = Effect(
    id="coulomb_friction",
    term="-a*tanh(v/w)",
    roles={"v": "rate"},
    sentence="Dry contact resists with a constant force against the motion, whatever the speed.",
    dimension="rate",
    sign=1,
    inner={"w": Inner("spread", 0.02, 2e-4, 0.3)},
    family="the resistance hardly depends on speed",
    law="friction",
)
