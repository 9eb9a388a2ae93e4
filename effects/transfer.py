"""A flow from one store to another."""

from suite.effect import Effect

EFFECT = Effect(
    id="transfer",
    term="+a*y",
    roles={"x": "content", "y": "source"},
    sentence="What one store loses another gains: immunity that wanes, a return flow, a leak between two vessels.",
    dimension="1/time",
    sign=1,
    family="what one store loses another gains",
)
