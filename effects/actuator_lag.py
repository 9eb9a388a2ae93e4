"""An actuator that follows with a lag."""

from suite.effect import Added, Effect, Inner

EFFECT = Effect(
    id="actuator_lag",
    term="+a*(z - u)",
    roles={"u": "input"},
    sentence="The actuator follows its command with a first-order lag.",
    dimension="1",
    pinned=True,
    inner={"w": Inner("step", 3.0, 1.0, 1e3, (1.0, 4.0, 15.0))},
    states={"z": Added("(u - z)/w", start="u", free=True)},
    family="the input acts otherwise than it is recorded",
)
