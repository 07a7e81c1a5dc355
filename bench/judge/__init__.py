"""Evaluate runs: pure functions on arrays and plain values, without side effects."""
