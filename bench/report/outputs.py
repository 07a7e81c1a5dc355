"""Write all files of a comparison: tables, figures, pages, trajectories."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bench.judge.metrics import ORIENTATION_CLASS_WIDTH, TRANSLATION_CLASS_WIDTH
from bench.report import figures, palette, pareto, tables, text
from bench.report.lines import DECIDING_SPANS, deciding_span
from bench.results import RESULTS_FILE, Comparison
from slams.formats import trajectory

if TYPE_CHECKING:
    from bench.results import LogResult, Outcome

TRUE_MAP_NAME = "true map"
# files that this and earlier versions write
OUTPUT_FILES = (
    *(RESULTS_FILE, "arrays.npz", "report.html", "tables.md", "table-*.csv", "errors-*.csv"),
    *("trajectory-*.tum", "fig*.png", "fig*.pdf", "rescue-*.npz", "result-*.mcap"),
)


def write(folder: Path, comparison: Comparison) -> None:
    """Write all files except results.json; each of several logs gets its own folder."""
    from bench.report.html import document

    for k in range(len(comparison.logs)):
        place = place_of(folder, comparison, k)
        place.mkdir(exist_ok=True)
        log = comparison.logs[k]
        words = text.as_markdown(log.entry, log.rows)
        (place / "tables.md").write_text(words, encoding="utf-8")
        text.write_csv(place, tables.tables(log.entry, log.rows))
        for outcome in log.outcomes:
            _write_run(place, outcome)
        _draw(place, log)
        document.write(place, comparison, log)
    if len(comparison.logs) > 1:
        logs = tables.logs_table(comparison)
        logs.to_csv(folder / "table-logs.csv", index_label="algorithm")
        links = [place_of(folder, comparison, k).name for k in range(len(comparison.logs))]
        _draw_joint(folder, comparison)
        document.write_joint(folder, comparison, links)


def place_of(folder: Path, comparison: Comparison, k: int) -> Path:
    """The folder of the k-th log's files: that of the comparison for a single log."""
    name = file_name(comparison.logs[k].entry["name"])
    return folder if len(comparison.logs) == 1 else folder / f"{k + 1}-{name}"


def file_name(label: str) -> str:
    """A label as part of a file's name."""
    return label.replace(":", ".").replace("@", "-").replace("/", "-")


def _write_run(folder: Path, outcome: Outcome) -> None:
    """Errors per update and trajectory of a run."""
    name = file_name(outcome.row["algorithm"])
    if "update" in outcome.errors:
        text.write_errors(folder / f"errors-{name}.csv", outcome.errors["update"])
    if len(outcome.t):
        trajectory.write_tum(folder / f"trajectory-{name}.tum", outcome.t, outcome.poses)


def _draw(folder: Path, log: LogResult) -> None:
    """[Kuehn] Fig. 2 to 4, errors and costs, and paths, if the log and its runs have them."""
    looks = palette.looks([row["algorithm"] for row in log.rows])
    errors = {o.row["algorithm"]: o.errors for o in log.outcomes if o.errors}
    if errors:
        for number, kind, width in (
            (2, "translation", TRANSLATION_CLASS_WIDTH),
            (3, "orientation", ORIENTATION_CLASS_WIDTH),
        ):
            values = {name: getattr(found["update"], kind) for name, found in errors.items()}
            figures.save_histogram(values, kind, width, looks, folder / f"fig{number}_{kind}")
    span = deciding_span(log.rows) or ""
    small = {name: 1e3 * found[span].se2_translation for name, found in errors.items()}
    points = pareto.drawn(Comparison({}, [log], []))
    what = f"error {DECIDING_SPANS.get(span)}"
    figures.save_overview(small, what, points, looks, folder / "fig_errors")
    _draw_paths(folder, log, looks)
    _draw_maps(folder, log, looks)


def _draw_paths(folder: Path, log: LogResult, looks: figures.Looks) -> None:
    """The paths of all runs and the true path, in the frame of the first pose."""
    runs = [outcome for outcome in log.outcomes if len(outcome.t)]
    paths = {o.row["algorithm"]: o.common.estimate if o.common else o.poses for o in runs}
    truth = next((o.common.truth for o in runs if o.common), None)
    if paths:
        figures.save_trajectories(paths, truth, looks, folder / "fig_trajectories")


def _draw_maps(folder: Path, log: LogResult, looks: figures.Looks) -> None:
    """[Kuehn] Fig. 4: the true map and the maps of all runs."""
    plans = {
        o.row["algorithm"]: figures.Plan(o.grid, o.frame, o.poses)
        for o in log.outcomes
        if o.grid is not None
    }
    if not plans:
        return
    start, known = log.reference.start, log.reference.grid
    if start is not None and known is not None:
        plans = {TRUE_MAP_NAME: figures.Plan(known, start, None)} | plans
    # a ground truth that begins late has another first pose than the maps
    truth = None if start is None else log.reference.path
    figures.save_maps(plans, truth, looks, folder / "fig4_maps")


def _draw_joint(folder: Path, comparison: Comparison) -> None:
    """Absolute errors of all runs, inf for failed ones, and the costs over all logs."""
    errors = {
        name: np.array([1e3 * e["ate_m"] if (e := row.get("errors")) else np.inf for row in rows])
        for name, rows in comparison.by_algorithm().items()
    }
    found = {name: values for name, values in errors.items() if np.isfinite(values).any()}
    looks, place = palette.looks([*errors]), folder / "fig_errors"
    figures.save_overview(found, "absolute error", pareto.drawn(comparison), looks, place)
