"""Cefamandole in the blood of six subjects after a dose: one compartment is not enough. Measured."""

from cases._dose import drug
from suite.model import Parameter

CASE = drug(
    name="cefamandole",
    sentence="Cefamandole in the plasma of six subjects against one compartment; the tissue, a second one, is missing.",
    package="nlme",
    table="Cefamandole",
    time="Time",
    k=Parameter(0.02, unit="1/min"),
    first=100.0,
)
