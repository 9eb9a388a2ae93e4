"""A quadratic term that follows the sign of the state."""

from suite.effect import Effect

EFFECT = Effect(
    id="absolute_term",
    term="-a*D*abs(D)",
    roles={"x": "state", "D": "deviation"},
    sentence="The rate lacks a loss that grows with the square of the state's size.",
    dimension="1/(state time)",
    family="the loss grows faster than proportionally",
    generic=True,
    law="loss",
)
