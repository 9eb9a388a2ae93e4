"""Kalman filters from filterpy, one a file, on the same contract as the estimators."""
