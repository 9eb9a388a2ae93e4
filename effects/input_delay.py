"""An input that acts later than it is recorded."""

from suite.effect import Effect

EFFECT = Effect(
    id="input_delay",
    term="+late - u",
    roles={"u": "input", "late": "late"},
    sentence="The input acts later than it is recorded: transport, computation, a shifted column.",
    dimension="time",
    sign=1,
    family="the input acts otherwise than it is recorded",
)
