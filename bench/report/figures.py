"""Figures as png and pdf: histograms and maps, [Kuehn] Fig. 2 to 4; errors, and against cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bench.judge.metrics import class_shares
from bench.report.palette import LINES, RIGHT, UNKNOWN, bar_length, shade
from bench.report.pareto import Point, front, spread
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CLASSES = 8
FEW = 6  # maps that stand three in a row; more stand four in a row
SHOWN_FROM = 0.02  # of its values: where the axis of the errors begins
NICE = (1.0, 2.0, 2.5, 5.0, 10.0)  # widths of a class, times a power of ten


def class_width(errors: Sequence[Floats], most: float) -> float:
    """Width of a histogram's classes: the paper's `most`, or less where errors are smaller.

    The middle run's 95th percentile lies within the classes: in those of the paper good algorithms
    of today never leave the first.
    """
    reach = float(np.median([np.percentile(values, 95) for values in errors])) / (CLASSES - 1)
    power = 10.0 ** np.floor(np.log10(max(reach, 1e-9)))
    return min(most, float(next(f * power for f in NICE if f * power >= reach * (1 - 1e-9))))


def histograms(
    errors: dict[str, Floats], kind: str, most: float, color_of: dict[str, str], path: Path
) -> None:
    """[Kuehn] Fig. 2 (kind "translation", [m]) or 3 ("orientation", [rad]): shares per class.

    Writes `path` with the endings png and pdf.
    """
    unit = "mm" if kind == "translation" else "mrad"
    width = class_width(list(errors.values()), most)
    figure = Figure(figsize=(9, 4), layout="constrained")
    bars = figure.subplots()
    edges, thickness = width * np.arange(CLASSES), 0.8 * width / max(len(errors), 1)
    for k, (name, values) in enumerate(errors.items()):
        middle = edges + (k + 0.5) * thickness + 0.1 * width
        shares = class_shares(values, width, CLASSES)
        bars.bar(middle, shares, thickness, color=color_of[name], label=name)
    texts = [f"{1e3 * edge:.3g}" for edge in edges]
    bars.set_xticks(edges, [*texts[:-1], f"≥ {texts[-1]}"])
    bars.set(xlabel=f"error of {kind} per update [{unit}]", ylabel="relative frequency")
    bars.legend(fontsize=8)
    _save(figure, path)


def overview(
    errors: dict[str, Floats], points: Sequence[Point], color_of: dict[str, str], path: Path
) -> None:
    """Shares of the poses with errors [mm] below a value; mean error against CPU per scan."""
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    curves, costs = figure.subplots(1, 2)
    for k, (name, values) in enumerate(errors.items()):
        below = (np.arange(len(values)) + 1) / len(values)
        line = LINES[k % len(LINES)]
        ordered = np.maximum(np.sort(values), 1e-3)
        curves.plot(ordered, below, line, color=color_of[name], label=name)
    low = min(float(np.quantile(values, SHOWN_FROM)) for values in errors.values())
    curves.set(xscale="log", xlabel="error over 1 s [mm]", ylabel="share of poses below")
    curves.set_xlim(left=max(low, 1e-3))
    curves.legend(loc="lower right", fontsize=8)
    costs.set(xscale="log", yscale="log", xlabel="CPU per scan [ms]", ylabel="mean error [mm]")
    for point in points:
        marker = "x" if point.lost else "o"
        costs.plot(point.cpu_ms, point.error_mm, marker, color=color_of[point.name])
    costs.margins(0.18)
    _write_names(costs, points)
    best = front(points)
    costs.plot([p.cpu_ms for p in best], [p.error_mm for p in best], color="0.5", linewidth=0.8)
    for axes in (curves, costs):
        axes.grid(visible=True, which="both", alpha=0.25)
    _save(figure, path)


def _write_names(axes: Axes, points: Sequence[Point]) -> None:
    """The names of the points beside them, none over another."""
    to_share = axes.transData + axes.transAxes.inverted()
    axes.autoscale_view()
    at = [to_share.transform((point.cpu_ms, point.error_mm)) for point in points]
    for point, (x, _), y in zip(points, at, spread([(x, y) for x, y in at]), strict=True):
        side, shift = ("right", -0.015) if x > RIGHT else ("left", 0.015)
        axes.text(x + shift, y, point.name, transform=axes.transAxes, fontsize=8, ha=side)


def maps(
    grids: Mapping[str, tuple[OccupancyGrid, Pose2]],
    paths: Mapping[str, Floats],
    truth: Floats | None,
    color_of: Mapping[str, str],
    path: Path,
) -> None:
    """[Kuehn] Fig. 4: the maps side by side, each with its path; the true path dashed.

    grids with the pose of the first scan in each one's frame; paths (n, 3) and truth (m, 3) seen
    from that pose. Writes `path` with the endings png and pdf.
    """
    columns = min(3 if len(grids) <= FEW else 4, len(grids))
    rows = -(-len(grids) // columns)
    figure = Figure(figsize=(4.0 * columns, 4.0 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for axes in panels[len(grids) :]:
        axes.set_visible(False)
    limits = _limits(truth if truth is not None else np.concatenate(list(paths.values())))
    for axes, (name, (grid, frame)) in zip(panels, grids.items(), strict=False):
        _draw_map(axes, grid, frame.inverse())
        if truth is not None:
            axes.plot(truth[:, 0], truth[:, 1], color="0.4", linewidth=0.8, linestyle="--")
        axes.plot(paths[name][:, 0], paths[name][:, 1], color=color_of[name], linewidth=1.0)
        axes.set_title(name)
        axes.set(xlim=limits[0], ylim=limits[1], xticks=[], yticks=[])
        _draw_bar(axes, limits)
    _save(figure, path)


def _draw_map(axes: Axes, grid: OccupancyGrid, moved: Pose2) -> None:
    """A map in gray, its frame laid at a pose."""
    from matplotlib.transforms import Affine2D

    place = Affine2D().rotate(moved.theta).translate(moved.x, moved.y)
    height, width = grid.p.shape
    x, y = grid.origin
    extent = (x, x + width * grid.resolution, y, y + height * grid.resolution)
    axes.imshow(
        shade(grid.p),
        cmap="gray",
        vmin=0,
        vmax=1,
        origin="lower",
        extent=extent,
        interpolation="antialiased",
        transform=axes.transData if moved == IDENTITY else place + axes.transData,
    )
    axes.set_aspect("equal")
    axes.set_facecolor(f"{UNKNOWN}")


def _draw_bar(axes: Axes, limits: tuple[tuple[float, float], tuple[float, float]]) -> None:
    """A scale bar in the lower left corner."""
    (left, right), (low, high) = limits
    length, x, y = bar_length(right - left), left + 0.04 * (right - left), low + 0.04 * (high - low)
    axes.plot([x, x + length], [y, y], color="black", linewidth=3, solid_capstyle="butt")
    axes.text(x, y + 0.01 * (high - low), f"{length:g} m", fontsize=9, va="bottom")


def _limits(way: Floats, margin: float = 6.0) -> tuple[tuple[float, float], tuple[float, float]]:
    low, high = way[:, :2].min(axis=0) - margin, way[:, :2].max(axis=0) + margin
    return (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))


def _save(figure: Figure, path: Path) -> None:
    """As png to look at and as pdf to print; no date inside: same figure, same bytes."""
    canvas = FigureCanvasAgg(figure)
    canvas.print_figure(path.with_suffix(".png"), dpi=110, metadata={"Software": None})
    canvas.print_figure(path.with_suffix(".pdf"), metadata={"CreationDate": None})
