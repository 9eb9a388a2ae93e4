"""A baseball falls 47 m, filmed twice. Measured."""

from cases._falling_ball import ball

CASE = ball(
    name="baseball",
    what="a baseball",
    file="baseball",
    sums=(
        "b5fdbf64bf16dc9204fff904c21c9f530d6a8003a5d37f817a7831ec5f6bd707",
        "0d45fcddf9806e7746d47a94f5ca31bb5ef0ca009a639e27144b1355a53f5f6a",
    ),
)
