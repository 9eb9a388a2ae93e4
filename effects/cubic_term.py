"""A cubic term."""

from suite.effect import Effect

EFFECT = Effect(
    id="cubic_term",
    term="-a*D**3",
    roles={"x": "state", "D": "deviation"},
    sentence="The rate lacks a part that grows with the cube of the state.",
    dimension="1/(state^2 time)",
    family="the loss grows faster than proportionally",
    generic=True,
    law="loss",
)
