"""Everything drawn from the results of a comparison: tables, figures, pages, trajectories."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bench.judge.metrics import ORIENTATION_CLASS, TRANSLATION_CLASS
from bench.report import figures, palette, pareto, tables, text
from bench.results import FIGURES
from slams.formats import trajectory

if TYPE_CHECKING:
    from bench.results import Comparison, LogResult, Outcome

# all that bench.compare writes; arrays.npz is of earlier versions
FILES = (
    FIGURES,
    "arrays.npz",
    "report.html",
    "tables.md",
    "table-*.csv",
    "errors-*.csv",
    "trajectory-*.tum",
    "fig*.png",
    "fig*.pdf",
    "rescue-*.npz",
    "result-*.mcap",
)


def write(folder: Path, comparison: Comparison) -> None:
    """Write all files but the results themselves; several logs get a folder each."""
    from bench.report import html

    for k in range(len(comparison.logs)):
        place = place_of(folder, comparison, k)
        place.mkdir(exist_ok=True)
        log = comparison.logs[k]
        text.write_tables(place, log.entry, log.rows)
        for outcome in log.outcomes:
            _write_run(place, outcome)
        _draw_errors(place, log)
        _draw_maps(place, log)
        html.write(place / "report.html", comparison, log)
    if len(comparison.logs) > 1:
        logs = tables.logs_table(comparison)
        logs.to_csv(folder / "table-logs.csv", index_label="algorithm")
        links = [place_of(folder, comparison, k).name for k in range(len(comparison.logs))]
        html.write_joint(folder / "report.html", comparison, links)


def place_of(folder: Path, comparison: Comparison, k: int) -> Path:
    """The folder of the k-th log's files: that of the comparison where it is the only one."""
    name = comparison.logs[k].entry["name"]
    return folder if len(comparison.logs) == 1 else folder / f"{k + 1}-{name}"


def file_name(label: str) -> str:
    """A label as part of a file's name."""
    return label.replace(":", ".").replace("@", "-")


def _write_run(folder: Path, outcome: Outcome) -> None:
    """Errors per update and trajectory of a run."""
    name = file_name(outcome.row["algorithm"])
    if "update" in outcome.errors:
        text.write_errors(folder / f"errors-{name}.csv", outcome.errors["update"])
    if len(outcome.t):
        trajectory.write_tum(folder / f"trajectory-{name}.tum", outcome.t, outcome.poses)


def _draw_errors(folder: Path, log: LogResult) -> None:
    """[Kuehn] Fig. 2 and 3, and the errors over 1 s, where the log has a truth."""
    errors = {o.row["algorithm"]: o.errors["update"] for o in log.outcomes if "update" in o.errors}
    if not errors:
        return
    for number, kind, most in (
        (2, "translation", TRANSLATION_CLASS),
        (3, "orientation", ORIENTATION_CLASS),
    ):
        values = {name: getattr(found, kind) for name, found in errors.items()}
        figures.save_histogram(values, kind, most, _looks(log), folder / f"fig{number}_{kind}")
    second = {o.row["algorithm"]: o.errors["1 s"] for o in log.outcomes if "1 s" in o.errors}
    if second:
        small = {name: 1e3 * found.se2_translation for name, found in second.items()}
        figures.save_overview(small, pareto.drawn_of(log), _looks(log), folder / "fig_errors")


def _draw_maps(folder: Path, log: LogResult) -> None:
    """[Kuehn] Fig. 4, of the runs that have a map."""
    plans = {
        o.row["algorithm"]: figures.Plan(o.grid, o.frame, o.poses)
        for o in log.outcomes
        if o.grid is not None
    }
    if not plans:
        return
    # a truth that begins late is seen from another pose than the maps are
    truth = None if log.reference.start is None else log.reference.path
    figures.save_maps(plans, truth, _looks(log), folder / "fig4_maps")


def _looks(log: LogResult) -> dict[str, palette.Look]:
    return palette.looks([row["algorithm"] for row in log.rows])
