"""Reading of a scan: end points in the base frame, noise of the ranges, normals."""
