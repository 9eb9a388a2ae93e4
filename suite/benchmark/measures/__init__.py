"""Metrics, one a file: a file's place here is its registration; other distributions use `unmodelled.metrics`."""
