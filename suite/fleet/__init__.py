"""A verdict for every machine of a fleet: one file each, in parallel, ranked by how the model fails."""
