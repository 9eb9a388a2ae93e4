"""Dry friction that is larger at rest than in motion."""

from suite.effect import Effect, Inner

EFFECT = Effect(
    id="stribeck_friction",
    term="-(a + b*exp(-(v/s)**2))*tanh(v/w)",
    roles={"v": "rate"},
    sentence="A joint sticks: its friction is largest at rest and falls as the contact starts to slide.",
    dimension="rate",
    coefficients=("a", "b"),
    sign=1,
    inner={"w": Inner("spread", 0.02, 2e-4, 0.1), "s": Inner("spread", 0.1, 0.01, 0.5)},
    family="the resistance hardly depends on speed",
    law="friction",
)
