"""The rocket Andromeda coasts to its apogee: gravity alone is not enough. Measured."""

from cases._coasting_rocket import rocket

CASE = rocket(
    name="rocket-andromeda",
    what="Andromeda",
    file="andromeda_flight_data.csv",
    sha256="ebd3b757555b564c63937b69d2c222d6596355fc6e938d49537af293a9d48d14",
    upstream="andromeda/flight_data.csv",
    columns=("t(s)", "alt(m)"),
    coast=(6.2, 26.75),
)
