"""Seen from above: the trajectories, and the maps side by side, [Kuehn] Fig. 4."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bench.report.html.markup import Markup, element
from bench.report.html.pictures import picture
from bench.report.html.plots import Axis, Note, figure, line, plot, thinned
from bench.report.html.runs import Run
from bench.report.palette import bar_length
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from bench.results import LogResult

MARGIN = 0.04  # of the shown part around what it must show
AROUND_MAP = 1.0  # m
AROUND_PATH = 15.0  # m around the paths in which walls are shown
WIDEST = 2.0  # width of a plan over its height
LARGER = 1.5  # times the size of the middle run: such a path has left the place
STILL = 0.1  # m, least size of a plan


def trajectories(shown: Sequence[Run], done: LogResult) -> Markup | None:
    """All paths in one plan, with the true one."""
    ways = {run: _seen_from_first(run) for run in shown if len(run.outcome.t)}
    if not ways:
        return None
    true = next((run.outcome.common.truth for run in ways if run.outcome.common), None)
    whole = done.reference.path if done.reference.path is not None else true
    x, y = _plan(_extent(_kept(ways) if whole is None else [whole]), narrowest=1.4)
    marks = [] if true is None else [_way(true, (x, y), "truth", "true path", id="truth")]
    marks += [_way(way, (x, y), run.mark, run.name) for run, way in ways.items()]
    words = "this log has no truth" if true is None else "the broad line is the true one"
    return figure(
        f"Paths seen from the first pose; {words}.",
        plot("trajectories of all algorithms", x, y, marks, "xy", "plan"),
    )


def maps(shown: Sequence[Run], done: LogResult) -> Markup | None:
    """[Kuehn] Fig. 4: the maps side by side in one scale, each with its path."""
    grids = {run: run.outcome.grid for run in shown if run.outcome.grid is not None}
    if not grids:
        return None
    start, known = done.reference.start, done.reference.grid
    path = None if start is None else done.reference.path  # else in another frame than the maps
    ways = _kept({run: run.outcome.poses for run in grids}) if path is None else [path]
    reach = _extent(ways) + AROUND_PATH * np.array([[-1.0], [1.0]])
    walls = [
        np.clip(_walls(grid, run.outcome.frame), *reach)
        for run, grid in grids.items()
        if not run.lost
    ]
    axes = _plan(np.concatenate([_extent(ways), *walls]), narrowest=0.8)
    true = [] if path is None else [_way(path, axes, "truth", "true path")]
    panels = []
    if known is not None and start is not None:
        finest = min(grid.resolution for grid in grids.values())
        image = picture(known, "true map", into(start), finest)
        panels.append(_panel("true map", axes, [image, *true]))
    for run, grid in grids.items():
        way = _way(run.outcome.poses, axes, run.kind, run.name)
        frame = run.outcome.frame
        image = picture(grid, run.name, None if frame == IDENTITY else into(frame))
        panels.append(_panel(run.name, axes, [image, *true, way], run.mark))
    return figure(
        "Fig. 4 of the paper: white is free, black occupied, gray never observed (black and white "
        "change places on a dark page). Each map with its path"
        f"{' and, broad, the true one' if true else ''}.",
        element("div", *panels, class_="maps"),
    )


def _seen_from_first(run: Run) -> Floats:
    """The path in the frame of the truth, where there is one."""
    common = run.outcome.common
    return run.outcome.poses if common is None else common.estimate


def _kept(ways: dict[Run, Floats]) -> list[Floats]:
    """The paths that set the shown part: none of lost runs, or far larger ones, if others are."""
    found = [way for run, way in ways.items() if not run.lost] or list(ways.values())
    sizes = [float(np.ptp(way[:, :2], axis=0).max()) for way in found]
    most = LARGER * float(np.median(sizes))
    return [way for way, size in zip(found, sizes, strict=True) if size <= most]


def _way(
    poses: Floats, axes: tuple[Axis, Axis], kind: str, title: str, **attributes: object
) -> Markup:
    chosen = poses[thinned(len(poses))]
    return line(chosen[:, 0], chosen[:, 1], axes, kind, title, **attributes)


def _panel(name: str, axes: tuple[Axis, Axis], marks: list[Markup], kind: str = "") -> Markup:
    """A map with its scale bar."""
    x, y = axes
    length, left, low = bar_length(x.span), x.low + 0.04 * x.span, y.low + 0.04 * y.span
    ends = np.array([left, left + length]), np.array([low, low])
    scale = line(*ends, axes, "scale", f"{length:g} m")
    notes = [Note(left, low + 0.01 * y.span, f"{length:g} m", "scale")]
    drawn = plot(f"map: {name}", *axes, [*marks, scale], "xy", "map", notes)
    return element("div", element("h3", name), drawn, class_=f"panel {kind}".rstrip())


def _extent(ways: Sequence[Floats]) -> Floats:
    """Lower left and upper right corner (2, 2) of all ways."""
    points = np.concatenate([way[:, :2] for way in ways])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _walls(grid: OccupancyGrid, frame: Pose2) -> Floats:
    """Corners (2, 2) of the part of a map with nearly all of its occupied cells; none: (0, 2)."""
    cells = np.argwhere(grid.p > 0.5)[:, ::-1]
    if not len(cells):
        return np.zeros((0, 2))
    points = frame.inverse().transform(cells * grid.resolution + np.array(grid.origin))
    corners = np.percentile(points, (0.5, 99.5), axis=0)
    around: Floats = corners + AROUND_MAP * np.array([[-1.0], [1.0]])
    return around


def _plan(corners: Floats, narrowest: float) -> tuple[Axis, Axis]:
    """Axes of one scale around all corners, neither too flat nor too tall for a page."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = np.maximum((high - low) * (1.0 + 2.0 * MARGIN), STILL)
    width = max(size[0], narrowest * size[1])
    height = max(size[1], width / WIDEST)
    x, y = 0.5 * (low + high)
    return (
        Axis("x [m]", float(x - 0.5 * width), float(x + 0.5 * width)),
        Axis("y [m]", float(y - 0.5 * height), float(y + 0.5 * height)),
    )


def into(start: Pose2) -> str:
    """The SVG transform from the world to the frame of the first pose."""
    return f"rotate({-math.degrees(start.theta):.6f}) translate({-start.x:.6f} {-start.y:.6f})"
