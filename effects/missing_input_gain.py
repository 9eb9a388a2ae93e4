"""An actuator that gives more or less than it is told."""

from suite.effect import Effect

EFFECT = Effect(
    id="missing_input_gain",
    term="+a*u",
    roles={"u": "input"},
    sentence="The input acts more or less strongly than its column says: a wrong gain, unit or supply voltage.",
    dimension="1",
    family="the input acts otherwise than it is recorded",
)
