"""Compiled numerics: scalar loops over arrays that the caller allocates; every kernel says which it writes."""
