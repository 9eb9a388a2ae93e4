"""A term in proportion to the state."""

from suite.effect import Effect

EFFECT = Effect(
    id="linear_term",
    term="-a*D",
    roles={"x": "state", "D": "deviation"},
    sentence="The rate lacks a part in proportion to the state.",
    dimension="1/time",
    family="the loss is proportional",
    generic=True,
)
