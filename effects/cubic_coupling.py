"""Another state acts with its cube."""

from suite.effect import Effect

EFFECT = Effect(
    id="cubic_coupling",
    term="+a*y**3",
    roles={"x": "any", "y": "other"},
    sentence="Another state acts with its cube.",
    dimension="1/(state^2 time)",
    family="another state acts",
    generic=True,
    law="coupling",
)
