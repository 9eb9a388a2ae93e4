"""The rocket Genesis coasts to its apogee: gravity alone is not enough. Measured."""

from cases._coasting_rocket import rocket

CASE = rocket(
    name="rocket-genesis",
    what="Genesis",
    file="genesis_flight_data_faraday.csv",
    sha256="d88a7fc53cbd55d1dafeed5d5c6fcfcad27c7cf8e0a15221e67aae97eaa05a74",
    upstream="genesis/flight_data_faraday.csv",
    columns=("ts", "filtered_altitude_AGL"),
    coast=(5.7, 24.18),
)
