"""The summary of a run as one dict for JSON, and as text."""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from slams import __version__, metrics
from slams.laser_table import silent_lasers
from slams.params import Params
from slams.player import Run
from slams.scanlog import ScanLog
from slams.types import Floats

ERROR_SPANS = {  # time [s] over which errors are taken, 0: each update; its description
    "per_update": (0.0, "per update"),
    "per_1_s": (1.0, "over 1 s"),
    "per_10_s": (10.0, "over 10 s"),
}
# counts of a summary or a report that become notes for the user
NOTED_COUNTS = {
    "stamps_back": "stamps jump back (scans are used in the order of the log)",
    "scans_without_attitude": "scans have no attitude and are taken as level",
    "scans_without_return": "scans have no return at all",
    "too_far": "scans not inserted into the map: the robot cannot have reached their poses",
    "too_large": "scans not inserted into the map: it has reached max_cells (--set max_cells=N)",
    "attitude_beyond": "scans with an impossible attitude: not used; is the IMU upside down?",
    "attitude_jumped": "scans after a jump of the attitude: not used until the floor confirms it",
    "attitude_stuck": "scans with a constant attitude while the robot moves: not used",
    "attitude_contradicted": "scans whose attitude the floor contradicts: not used; signs, axes?",
    "attitude_late_ms": "ms, about, of delay of the attitude",
    "collapsed": "times the maps of the particles exceeded max_tiles: all continued from the best",
}
MAX_NOTED_SHARE = 0.05  # of the scans; fewer in conflict may be due to a door that opened
VERSIONED_LIBRARIES = (
    "numpy",
    "numba",
    "scipy",
    "opencv-python-headless",
    "kiss-icp",
    "pandas",
    "matplotlib",
)


def summarize(
    run: Run,
    log: ScanLog,
    label: str,
    params: Params,
    start_up_s: float,
) -> dict[str, Any]:
    """The summary of one run.

    Args:
        run: the result of `replay`.
        log: its log.
        label: the algorithm, as named by the user.
        params: its parameters.
        start_up_s: CPU seconds of loading and compiling before the run.
    """
    duration = float(run.t.max() - run.t.min())
    spent, attitudes = cost(run.seconds, duration), log.attitude_at_scans()
    attitudes = np.zeros((0, 2)) if attitudes is None else attitudes  # no IMU: none is missing
    return {
        "algorithm": label,
        "log": log.name,
        "scans": len(run),
        "beams": log.laser.n_beams,
        "duration_s": duration,
        "path_length_m": metrics.path_length(run.final),
        "stamps_back": log.stamp_jumps,
        "scans_without_attitude": int((~np.isfinite(attitudes).all(axis=1)).sum()),
        "lasers": len(log.lasers),
        "silent_lasers": silent_lasers(log.t, log.numbers, len(log.lasers)),
        "scans_without_return": int((~np.isfinite(log.ranges).any(axis=1)).sum()),
        "cpu_ms_per_scan": spent["mean_ms"],
        "cpu_ms": {name: spent[f"{name}_ms"] for name in ("p50", "p95", "max")},
        "real_time_factor": spent["real_time_factor"],
        "compile_s": start_up_s + run.compile_s,
        "errors": truth_errors(run, log),
        "report": run.report,
        "seed": params.seed,
        "parameters": params.as_dict(),
        "meta": log.meta,
        "versions": versions(),
        "machine": f"{platform.machine()} {platform.system()}",
    }


def cost(seconds: Floats, duration: float) -> dict[str, float]:
    """CPU time per scan [ms], and the ratio of the log's duration to the CPU time.

    Args:
        seconds: CPU time (n,) [s] of each update, without compilation.
        duration: of the log [s].
    """
    p50, p95, p99 = (1e3 * np.percentile(seconds, (50, 95, 99))).tolist()
    return {
        "mean_ms": 1e3 * float(seconds.mean()),
        "p50_ms": p50,
        "p95_ms": p95,
        "p99_ms": p99,
        "max_ms": 1e3 * float(seconds.max()),
        "real_time_factor": duration / max(float(seconds.sum()), 1e-9),
    }


def truth_errors(run: Run, log: ScanLog) -> dict[str, Any] | None:
    """Relative SE(2) errors over each of `ERROR_SPANS`, and the ATE; None without truth.

    Poses at times without truth are left out and counted.
    """
    truth = log.truth_at(run.t)
    if truth is None:
        return None
    covered = ~np.isnan(truth[:, 0])
    estimate, truth = run.final[covered], truth[covered]
    errors: dict[str, Any] = {"not_covered": int((~covered).sum())}
    if len(truth) < 2:
        return errors
    t = run.t[covered]
    for key, (seconds, _) in ERROR_SPANS.items():
        pairs = metrics.pairs_over_time(t, seconds)
        if len(pairs[0]):
            over = metrics.pair_errors(estimate, truth, *pairs)
            named = zip(("translation_m", "rotation_rad"), map(moments, over), strict=True)
            errors[key] = dict(named)
    errors["ate_m"] = metrics.ate(estimate, truth)
    first = metrics.from_first(estimate) - metrics.from_first(truth)
    errors["end_m"] = float(math.hypot(first[-1, 0], first[-1, 1]))
    return errors


def versions(libraries: Sequence[str] = VERSIONED_LIBRARIES) -> dict[str, str]:
    """Versions of Python, of this package and of the libraries that results depend on."""
    found = {"python": platform.python_version(), "slams": __version__}
    for name in libraries:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def as_json(summary: dict[str, Any]) -> str:
    """The summary as strict JSON: numbers that are not finite become null."""
    text = json.dumps(summary, default=np.generic.item)
    return json.dumps(json.loads(text, parse_constant=lambda _: None), indent=2) + "\n"


def as_text(summary: dict[str, Any]) -> str:
    """The summary as a few lines for a terminal."""
    cpu = summary["cpu_ms"]
    lines = [
        f"{summary['algorithm']} on {summary['log']}: {summary['scans']} scans in "
        f"{summary['duration_s']:.1f} s, path {summary['path_length_m']:.1f} m"
    ]
    lines += _notes(summary)
    report = summary["report"]
    if "loops" in report:
        lines.append(
            f"{report['loops']} loops between {report['keyframes']} keyframes, map redrawn "
            f"{report['redrawn']} times; errors are those of the corrected poses at the end"
        )
    lines += _error_lines(summary["errors"])
    lines.append(
        f"CPU {summary['cpu_ms_per_scan']:.3f} ms per scan (median {cpu['p50']:.3f}, 95 % below "
        f"{cpu['p95']:.3f}, longest {cpu['max']:.1f}), {summary['real_time_factor']:.0f} times "
        f"real time; {summary['compile_s']:.1f} s to load and compile kernels"
    )
    counts = ", ".join(f"{name} {value}" for name, value in summary["report"].items())
    lines.append(f"scans: {counts}")
    return "\n".join(lines)


def _notes(summary: dict[str, Any]) -> list[str]:
    report = summary["report"]
    counts = report | summary
    notes = [f"{counts[key]} {words}" for key, words in NOTED_COUNTS.items() if counts.get(key)]
    notes += [
        f"laser {laser['laser']} sent no scan after {laser['last_s']:.1f} s"
        for laser in summary["silent_lasers"]
    ]
    few = MAX_NOTED_SHARE * summary["scans"]
    if report.get("lost", 0) > few:
        notes.append(f"{report['lost']} scans are lost: do not trust poses and map")
    if report.get("unlike", 0) > few:
        notes.append(f"{report['unlike']} scans are unlike the given map: another map or start?")
    if report.get("in_conflict", 0) > few:
        causes = "people or dust" if report.get("leveled") else "people, dust, or a tilting laser"
        notes.append(f"{report['in_conflict']} scans conflict with free space of the map: {causes}")
    return ["note: " + "; ".join(notes)] if notes else []


def _error_lines(errors: dict[str, Any] | None) -> list[str]:
    if errors is None:
        return ["no truth in the log: no errors"]
    head = "error against the truth    mean      max  [mm]     mean      max  [mrad]"
    lines = [head] if any(key in errors for key in ERROR_SPANS) else []
    for key, (_, name) in ERROR_SPANS.items():
        if key in errors:
            x, r = errors[key]["translation_m"], errors[key]["rotation_rad"]
            lines.append(
                f"  {name:20}{1e3 * x['mean']:9.2f}{1e3 * x['max']:9.2f}      "
                f"{1e3 * r['mean']:9.2f}{1e3 * r['max']:9.2f}"
            )
    if "ate_m" in errors:
        lines.append(
            f"  ATE {1e3 * errors['ate_m']:.1f} mm (rigidly aligned), "
            f"{1e3 * errors['end_m']:.1f} mm off at the end (from the first pose)"
        )
    if errors["not_covered"]:
        lines.append(f"  {errors['not_covered']} poses at times without truth are left out")
    return lines


def moments(values: Floats) -> dict[str, float]:
    """Mean, standard deviation (ddof 0), minimum and maximum."""
    return {
        "mean": float(values.mean()),
        "std": float(values.std()),
        "min": float(values.min()),
        "max": float(values.max()),
    }
