"""A number that is said to be exact, and is wrong."""

from suite.effect import Effect

EFFECT = Effect(
    id="wrong_value",
    term="+a",
    roles={"k": "fixed"},
    sentence="A parameter that the model file holds fixed has another value.",
    dimension="parameter",
    family="a number in the model is wrong",
)
