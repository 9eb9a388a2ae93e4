"""A second store behind the first."""

from suite.effect import Added, Effect, Inner

EFFECT = Effect(
    id="second_compartment",
    term="-a*(D - z)",
    roles={"x": "state", "D": "deviation"},
    sentence="A second store exchanges with this one: tissue behind the blood, a vessel's wall, a second thermal mass.",
    dimension="1/time",
    sign=1,
    inner={"w": Inner("time", 0.2, 0.002, 5.0, (1.0, 0.3, 0.1, 3.0))},
    states={"z": Added("(D - z)/w", free=True)},
    family="a second store fills and empties",
)
