"""Logs, pushes and bags whose numbers are wrong in every way, for `tests/test_fuzz.py`."""
