"""Refinement after the papers' matchers (ours): lines in map cells, and the fit to them."""
