"""Logs, pushes and bags whose numbers are wrong in every way; see `python -m tests.fuzz --help`."""
