"""Another state acts with its square."""

from suite.effect import Effect

EFFECT = Effect(
    id="quadratic_coupling",
    term="+a*y**2",
    roles={"x": "any", "y": "other"},
    sentence="Another state acts with its square.",
    dimension="1/(state time)",
    family="another state acts",
    generic=True,
    law="coupling",
)
