"""Model-error estimators, one method a file; a file here is in the matrix."""
