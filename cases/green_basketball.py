"""A lighter basketball falls 47 m, filmed twice. Measured."""

from cases._falling_ball import ball

CASE = ball(
    name="green-basketball",
    what="a lighter basketball",
    file="green_basketball",
    sums=(
        "91f1c3b5b2536959ed38d7cd3f3681208075ad9a155f96407609649c84d21a91",
        "92ecf29ebd91da3e0bdce46efe121062d528fcecd95b1daccde02208282171bd",
    ),
)
