"""report.html: one file with everything about one log; it works offline and without scripts."""

from bench.report.html.document import write

__all__ = ["write"]
