"""The matrix of cases, conditions, estimators, variants and seeds: run, store, judge, show."""
