"""Figures: histograms and maps, [Kuehn] Fig. 2 to 4; errors, errors against cost, trajectories.

Each figure is a png file, shown in the pages, and a pdf file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import NDArray

from bench.judge.metrics import class_shares
from bench.report.labels import write_names
from bench.report.palette import UNKNOWN_SHADE, Look, shade
from bench.report.pareto import Point, front
from slams.types import Floats, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

N_CLASSES = 8
MAX_MAPS_IN_THREE_COLUMNS = 6  # more maps stand in four columns
MAX_LARGE_NAMES = 12  # of a legend; more are written smaller
FIRST_SHOWN_QUANTILE = 0.02  # of the errors, where the axis begins
MAX_FINE_TICK_RATIO = 200.0  # of the ends of a logarithmic axis with ticks at 2 and 5
MIN_DRAWN_ERROR = 1e-3  # mm; smaller errors are drawn here
ROUND_WIDTHS = (1.0, 2.0, 2.5, 5.0, 10.0)  # of a class, times a power of ten
MAX_DRAWN_CELLS = 1000  # of a map's longer side; larger maps are reduced, walls stay visible
PATH_MARGIN = 6.0  # m around the paths, shown in maps
MAX_PATH_SIZE_RATIO = 1.5  # to the median path; larger paths diverged and do not set the limits

Looks = Mapping[str, Look]
Limits = tuple[tuple[float, float], tuple[float, float]]


class Plan(NamedTuple):
    """A map, the first scan's pose in its frame, and the path (n, 3) in the frame of this pose."""

    grid: OccupancyGrid
    frame: Pose2
    path: Floats | None


def class_width(errors: Sequence[Floats], max_width: float) -> float:
    """Width of a histogram's classes: the paper's `max_width`, or less for smaller errors.

    The classes contain the 95th percentile of the median run: in the paper's classes all errors of
    the defaults lie in the first.
    """
    reach = float(np.median([np.percentile(values, 95) for values in errors])) / (N_CLASSES - 1)
    power = 10.0 ** np.floor(np.log10(max(reach, 1e-9)))
    widths = (f * power for f in ROUND_WIDTHS)
    return min(max_width, float(next(width for width in widths if width >= reach * (1 - 1e-9))))


def shares_below(axes: Axes, errors: Mapping[str, Floats], what: str, looks: Looks) -> None:
    """Share of the errors [mm] below a value, a curve for each run; inf counts as above."""
    for name, values in errors.items():
        ordered = np.sort(np.maximum(values, MIN_DRAWN_ERROR))
        share = (np.arange(len(ordered)) + 1) / len(ordered)
        kept = np.isfinite(ordered)
        if not kept.any():
            continue
        look = looks[name]
        (drawn,) = axes.plot(ordered[kept], share[kept], look.line, color=look.color, label=name)
        drawn.set_drawstyle("steps-post")
    low = min(float(np.quantile(v, FIRST_SHOWN_QUANTILE, method="lower")) for v in errors.values())
    axes.set(xscale="log", xlabel=f"{what} [mm]", ylabel="share below")
    if np.isfinite(low):
        axes.set_xlim(left=max(0.9 * low, MIN_DRAWN_ERROR))
    plain_numbers(axes.xaxis)
    axes.grid(visible=True, which="both", alpha=0.25)
    if axes.get_lines():
        axes.legend(loc="best", fontsize=8 if len(errors) <= MAX_LARGE_NAMES else 6)


def against_cost(axes: Axes, points: Sequence[Point], looks: Looks) -> None:
    """Mean error against CPU per scan, with the Pareto front as a line."""
    axes.set(xscale="log", yscale="log", xlabel="CPU per scan [ms]", ylabel="mean error [mm]")
    places = {point.name: (point.cpu_ms, max(point.error_mm, MIN_DRAWN_ERROR)) for point in points}
    for point in points:
        marker = "x" if point.lost else "o"
        axes.plot(*places[point.name], marker, color=looks[point.name].color)
    best = np.array([places[point.name] for point in front(points)]).reshape(-1, 2)
    axes.plot(*best.T, color="0.5", linewidth=0.8)
    axes.margins(0.18)
    plain_numbers(axes.xaxis)
    plain_numbers(axes.yaxis)
    axes.grid(visible=True, which="both", alpha=0.25)
    write_names(axes, places, looks)


def map_panel(
    axes: Axes, name: str, plan: Plan, truth: Floats | None, limits: Limits, look: Look | None
) -> None:
    """[Kuehn] Fig. 4: a map in gray with its path and the true one, axes in meters."""
    _draw_map(axes, plan.grid, plan.frame.inverse())
    _true_path(axes, truth)
    if plan.path is not None and look is not None:
        _path(axes, plan.path, name, look)
    axes.set(xlim=limits[0], ylim=limits[1])


def limits_of(paths: Sequence[Floats], margin: float = PATH_MARGIN) -> Limits:
    """Limits of the shown area around paths, without paths far larger than the median."""
    sizes = [float(np.ptp(path[:, :2], axis=0).max()) for path in paths]
    max_size = MAX_PATH_SIZE_RATIO * float(np.median(sizes))
    kept = [path for path, size in zip(paths, sizes, strict=True) if size <= max_size]
    points = np.concatenate([path[:, :2] for path in kept or paths])
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    return (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))


def save_histogram(
    errors: Mapping[str, Floats], kind: str, max_width: float, looks: Looks, path: Path
) -> None:
    """Write [Kuehn] Fig. 2 (kind "translation", [m]) or 3 ("orientation", [rad]): shares by class.

    `path` gets the suffixes png and pdf.
    """
    figure = Figure(figsize=(9, 4), layout="constrained")
    axes = figure.subplots()
    unit = "mm" if kind == "translation" else "mrad"
    width = class_width(list(errors.values()), max_width)
    edges, thickness = width * np.arange(N_CLASSES), 0.8 * width / len(errors)
    for k, (name, values) in enumerate(errors.items()):
        middle = edges + (k + 0.5) * thickness + 0.1 * width
        shares = class_shares(values, width, N_CLASSES)
        look = looks[name]
        axes.bar(middle, shares, thickness, color=look.color, label=name)
    texts = [f"{1e3 * edge:.3g}" for edge in edges]
    axes.set_xticks(edges, [*texts[:-1], f"≥ {texts[-1]}"])
    axes.set(xlabel=f"error of {kind} per update [{unit}]", ylabel="relative frequency")
    axes.legend(fontsize=8)
    _save(figure, path)


def save_overview(
    errors: Mapping[str, Floats], what: str, points: Sequence[Point], looks: Looks, path: Path
) -> None:
    """Write the shares of errors [mm] below a value, and error against cost, if known."""
    n_panels = bool(errors) + bool(points)
    if not n_panels:
        return
    figure = Figure(figsize=(5.5 * n_panels, 4.2), layout="constrained")
    panels = figure.subplots(1, n_panels, squeeze=False)[0]
    if errors:
        shares_below(panels[0], errors, what, looks)
    if points:
        against_cost(panels[-1], points, looks)
    _save(figure, path)


def save_trajectories(
    paths: Mapping[str, Floats], truth: Floats | None, looks: Looks, path: Path
) -> None:
    """Write all paths (n, 3) and the true one in one plan, in the frame of the first pose."""
    figure = Figure(figsize=(7, 7), layout="constrained")
    axes = figure.subplots()
    for name, one in paths.items():
        _path(axes, one, name, looks[name])
    _true_path(axes, truth)
    x, y = limits_of([*paths.values()] if truth is None else [truth], margin=1.0)
    axes.set(xlim=x, ylim=y, xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal")
    axes.legend(fontsize=8)
    _save(figure, path)


def save_maps(plans: Mapping[str, Plan], truth: Floats | None, looks: Looks, path: Path) -> None:
    """Write [Kuehn] Fig. 4: the maps side by side at the same scale."""
    columns = min(3 if len(plans) <= MAX_MAPS_IN_THREE_COLUMNS else 4, len(plans))
    rows = -(-len(plans) // columns)
    figure = Figure(figsize=(4.0 * columns, 4.0 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for axes in panels[len(plans) :]:
        axes.set_visible(False)
    paths = [plan.path for plan in plans.values() if plan.path is not None]
    limits = limits_of(paths if truth is None else [truth])
    for axes, (name, plan) in zip(panels, plans.items(), strict=False):
        map_panel(axes, name, plan, truth, limits, looks.get(name))
        axes.set_title(name, parse_math=False)
    figure.supxlabel("x [m]")
    figure.supylabel("y [m]")
    _save(figure, path)


def plain_numbers(axis: Axis) -> None:
    """Ticks of a logarithmic axis as 0.5, 1, 2; of a long axis as 0.1, 1, 10."""
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high < MAX_FINE_TICK_RATIO * low else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def _path(axes: Axes, path: Floats, name: str, look: Look) -> None:
    axes.plot(*path[:, :2].T, color=look.color, linewidth=1.0, label=name)


def _true_path(axes: Axes, truth: Floats | None) -> None:
    if truth is not None:
        axes.plot(*truth[:, :2].T, "--", color="0.5", linewidth=0.8, label="truth")


def _draw_map(axes: Axes, grid: OccupancyGrid, moved: Pose2) -> None:
    """A map in gray, with its frame at the pose `moved`."""
    from matplotlib.transforms import Affine2D

    p, cell = _joined(grid.p), grid.resolution * _factor(grid.p)
    (x, y), (height, width) = grid.origin, p.shape
    place = Affine2D().rotate(moved.theta).translate(moved.x, moved.y)
    axes.imshow(
        shade(p),
        cmap="gray",
        vmin=0,
        vmax=1,
        origin="lower",
        extent=(x, x + width * cell, y, y + height * cell),
        interpolation="antialiased",
        transform=place + axes.transData,
    )
    axes.set_aspect("equal")
    axes.set_facecolor(f"{UNKNOWN_SHADE}")


def _factor(p: NDArray[np.floating]) -> int:
    return int(-(-max(p.shape) // MAX_DRAWN_CELLS))


def _joined(p: NDArray[np.floating]) -> NDArray[np.floating]:
    """The largest probability of each block of cells, to keep thin walls; nan is unknown."""
    factor = _factor(p)
    if factor == 1:
        return p
    height, width = (-(-n // factor) for n in p.shape)
    padded = np.full((height * factor, width * factor), -1.0)
    padded[: p.shape[0], : p.shape[1]] = np.where(np.isnan(p), -1.0, p)
    blocks = padded.reshape(height, factor, width, factor).max(axis=(1, 3))
    return np.where(blocks < 0.0, np.nan, blocks)


def _save(figure: Figure, path: Path) -> None:
    """Write png and pdf without a date, so that the same figure gives the same bytes."""
    canvas = FigureCanvasAgg(figure)
    canvas.print_figure(path.with_suffix(".png"), dpi=110, metadata={"Software": None})
    canvas.print_figure(path.with_suffix(".pdf"), metadata={"CreationDate": None})
