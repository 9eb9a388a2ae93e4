"""Two states act together."""

from suite.effect import Effect

EFFECT = Effect(
    id="product_coupling",
    term="+a*x*y",
    forms=("+a*y*z",),
    roles={"x": "any", "y": "other", "z": "another"},
    sentence="The rate depends on the product of two states: predation, a reaction, a modulated gain.",
    dimension="1/(state time)",
    family="two states act together",
)
