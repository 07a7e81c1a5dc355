"""Everything a comparison leaves behind: results.json first, all the rest made from it."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench import cases, figures, mapquality, report, timing, verdicts
from bench.tables import Line
from slams.formats import trajectory
from slams.summary import versions
from slams.types import Floats

if TYPE_CHECKING:
    from bench.cases import Choice, Outcome
    from bench.compare import Done
    from bench.reference import Reference
    from slams.ros.ros_params import Taken

FORMAT = "results-2"


def write(folder: Path, logs: list[Done], choice: Choice, arguments: argparse.Namespace) -> str:
    """Write all files to `folder`; returns the tables as text for the terminal."""
    from bench import html

    found = results(logs, choice, arguments)
    cases.write_results(folder / "results.json", found)
    texts = []
    for k, (log, entry) in enumerate(zip(logs, found["logs"], strict=True)):
        place = folder if len(logs) == 1 else folder / f"{k + 1}-{entry['name']}"
        place.mkdir(exist_ok=True)
        rows = [outcome.row for outcome in log.outcomes]
        report.write_tables(place, entry, rows)
        _write_runs(place, log.outcomes)
        _draw(place, log, entry)
        if arguments.mcap:
            _write_mcaps(place, log, choice)
        html.write(place / "report.html", found, entry, log)
        texts.append(report.as_text(entry, rows))
    texts += [entry["sentence"] for entry in report.neighbors(found["over_logs"])]
    return "\n\n".join(texts)


def results(logs: list[Done], choice: Choice, arguments: argparse.Namespace) -> dict[str, Any]:
    """The content of results.json."""
    rows = []
    for log in logs:
        log.reference.entry["verdicts"] = verdicts.on_one_log(log.outcomes)
        for outcome in log.outcomes:
            outcome.row["map"] = _map_quality(outcome, log.reference)
            rows.append(outcome.row)
        log.reference.entry["notes"] += _notes(log)
    every = [outcome for log in logs for outcome in log.outcomes]
    return {
        "format": FORMAT,
        "command": f"python -m bench.compare {shlex.join(arguments.words)}".strip(),
        "odometry": not arguments.no_odometry,
        "slower": arguments.slower,
        "ros_params": {label: _ros_files(taken) for label, taken in choice.ros.items()},
        "versions": versions(),
        "machine": timing.machine() | {"processes": arguments.jobs},
        "logs": [log.reference.entry for log in logs],
        "rows": rows,
        "over_logs": verdicts.over_logs(every) if len(logs) > 1 else [],
    }


def _ros_files(taken: Taken) -> dict[str, Any]:
    """What ROS files said and what became of it: enough to write them again."""
    fates = [fate._asdict() | {"value": str(fate.value)} for fate in taken.fates]
    return {"files": taken.files, "parameters": fates, "notes": taken.notes}


def _map_quality(outcome: Outcome, reference: Reference) -> dict[str, Any] | None:
    """The run's map against the true one, brought into the world by the true first pose."""
    if outcome.grid is None or reference.grid is None or reference.start is None:
        return None
    return mapquality.compare(outcome.grid, reference.grid, reference.start).as_dict()


def _notes(log: Done) -> list[str]:
    """What the user ought to know of relations that matched nothing."""
    found = [o.row["relations"] for o in log.outcomes if o.row.get("relations")]
    if not found:
        return []
    used, given = max(row["used"] for row in found), found[0]["given"]
    if used == 0:
        return [
            f"none of the {given} relations matches stamps of this log: are they another log's?"
        ]
    return [f"{used} of {given} relations have both stamps in the log"] if used < given else []


def _write_runs(folder: Path, outcomes: list[Outcome]) -> None:
    """Errors per update and trajectory of each run."""
    for outcome in outcomes:
        name = file_name(outcome.row["algorithm"])
        if "update" in outcome.errors:
            report.write_errors(folder / f"errors-{name}.csv", outcome.errors["update"])
        if len(outcome.t):
            trajectory.write_tum(folder / f"trajectory-{name}.tum", outcome.t, outcome.poses)


def _write_mcaps(folder: Path, log: Done, choice: Choice) -> None:
    """Map, path and scans of each run as one file for Foxglove, RViz and evo."""
    from slams.formats.mcap import write_mcap

    scans = choice.log(log.path)
    for outcome in log.outcomes:
        if outcome.grid is not None:
            path = folder / f"{file_name(outcome.row['algorithm'])}.mcap"
            write_mcap(path, scans, outcome.poses, outcome.grid)


def _draw(folder: Path, log: Done, entry: Line) -> None:
    """The paper's figures, as far as the log has a truth and the runs did not fail."""
    errors = {o.row["algorithm"]: o.errors["update"] for o in log.outcomes if "update" in o.errors}
    limit = (entry.get("bound") or {}).get("spans", {}).get("update", {})
    color_of = figures.colors([outcome.row["algorithm"] for outcome in log.outcomes])
    if errors:
        translation = {name: found.translation for name, found in errors.items()}
        orientation = {name: found.orientation for name, found in errors.items()}
        figures.histograms(
            translation,
            "translation",
            limit.get("translation_m"),
            color_of,
            folder / "fig2_translation",
        )
        figures.histograms(
            orientation,
            "orientation",
            limit.get("rotation_rad"),
            color_of,
            folder / "fig3_orientation",
        )
    grids = {o.row["algorithm"]: o.grid for o in log.outcomes if o.grid is not None}
    if grids:
        paths: dict[str, Floats] = {o.row["algorithm"]: o.poses for o in log.outcomes}
        # a truth that begins late is seen from another pose than the maps are
        truth = None if log.reference.start is None else log.reference.path
        figures.maps(grids, paths, truth, color_of, folder / "fig4_maps")


def file_name(label: str) -> str:
    """A label as part of a file's name."""
    return label.replace(":", ".").replace("@", "-")
