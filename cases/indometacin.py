"""Indometacin in the blood of six subjects after an injection: one compartment is not enough. Measured."""

from cases._dose import drug
from suite.model import Parameter

CASE = drug(
    name="indometacin",
    sentence="Indometacin in the plasma of six subjects against one compartment; the tissue, a second one, is missing.",
    package="datasets",
    table="Indometh",
    time="time",
    k=Parameter(0.5, unit="1/h"),
    first=1.5,
)
