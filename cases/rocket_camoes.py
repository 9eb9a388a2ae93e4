"""The rocket Camoes, which carries air brakes, coasts to its apogee: gravity alone is not enough. Measured."""

from cases._coasting_rocket import rocket

CASE = rocket(
    name="rocket-camoes",
    what="Camoes",
    file="camoes_flight_data.csv",
    sha256="8ceb1a196901569e32a6e9f09067feebb5ca1406d686e402f726e715a1be1dcc",
    upstream="camoes/flight_data.csv",
    columns=("ts", "filtered_altitude_AGL"),
    coast=(7.0, 23.78),
)
