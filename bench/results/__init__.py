"""Results as typed values, written and read: of a comparison (runs, logs) and of a sweep (trials).

Everything the benchmark shows is drawn from these.
"""

from bench.results.comparison import (
    FIGURES,
    FORMAT,
    Comparison,
    LogResult,
    read_figures,
    write_figures,
)
from bench.results.runs import Errors, Line, Outcome, Reference, Row, Rows

__all__ = [
    "FIGURES",
    "FORMAT",
    "Comparison",
    "Errors",
    "Line",
    "LogResult",
    "Outcome",
    "Reference",
    "Row",
    "Rows",
    "read_figures",
    "write_figures",
]
