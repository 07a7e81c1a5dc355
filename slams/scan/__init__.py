"""A scan as the matchers see it: end points in the base frame, their noise, their normals."""
