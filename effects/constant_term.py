"""A constant source or sink."""

from suite.effect import Effect

EFFECT = Effect(
    id="constant_term",
    term="+a",
    roles={"x": "state"},
    sentence="A steady source or sink.",
    dimension="state/time",
    generic=True,
)
