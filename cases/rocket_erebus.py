"""The rocket Erebus coasts to its apogee: gravity alone is not enough. Measured."""

from cases._coasting_rocket import rocket

CASE = rocket(
    name="rocket-erebus",
    what="Erebus",
    file="erebus11_flight_data_filtered.csv",
    sha256="045f5b9ed473b80095805d3ca7b831ca4b67c5afbe9156d58d1e91df9fc0b4a9",
    upstream="erebus11/flight_data_filtered.csv",
    columns=("t", "alt"),
    coast=(5.6, 22.9),
)
