"""A quadratic term that keeps its sign."""

from suite.effect import Effect

EFFECT = Effect(
    id="quadratic_term",
    term="-a*D**2",
    roles={"x": "state", "D": "deviation"},
    sentence="The rate lacks a part that grows with the square of the state.",
    dimension="1/(state time)",
    family="the loss grows faster than proportionally",
    generic=True,
    law="loss",
)
