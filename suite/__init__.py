"""unmodelled: find what an ODE model lacks, and judge the estimators that claim to."""

__version__ = "0.1.0"
