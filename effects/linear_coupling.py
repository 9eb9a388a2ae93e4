"""Another state acts."""

from suite.effect import Effect

EFFECT = Effect(
    id="linear_coupling",
    term="+a*y",
    roles={"x": "any", "y": "other"},
    sentence="Another state acts in proportion.",
    dimension="1/time",
    family="another state acts",
    generic=True,
)
