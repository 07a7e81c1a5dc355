"""Results as typed values, written and read: of a comparison (runs, logs) and of a sweep (trials).

Everything the benchmark shows is drawn from these.
"""

from bench.results.comparison import (
    ARRAYS,
    FIGURES,
    FORMAT,
    Comparison,
    LogResult,
    read,
    read_figures,
    save,
    write_figures,
)
from bench.results.runs import Errors, Line, Outcome, Reference, Row, Rows

__all__ = [
    "ARRAYS",
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
    "read",
    "read_figures",
    "save",
    "write_figures",
]
