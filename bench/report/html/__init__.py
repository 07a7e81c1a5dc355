"""report.html: one file with everything about one log; it works offline and without scripts."""

from bench.report.html.document import write
from bench.report.html.joint import write_joint

__all__ = ["write", "write_joint"]
