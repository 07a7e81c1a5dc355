"""Figures: the histograms of errors and the maps side by side, [Kuehn] Fig. 2, 3 and 4."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bench.judge.metrics import ORIENTATION_CLASS, TRANSLATION_CLASS, class_shares
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito: eight colors told apart with any color vision
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442", "#000000")
AGAIN = (("-", ""), ("--", "///"), (":", "xxx"))  # line and hatch where the colors come again
CLASSES = 8
FEW = 6  # maps that stand three in a row; more stand four in a row


def colors(names: list[str]) -> dict[str, str]:
    """A color for each run, the same in every figure, whichever of the runs it shows."""
    return {name: COLORS[k % len(COLORS)] for k, name in enumerate(names)}


def histograms(
    errors: dict[str, Floats], kind: str, limit: float | None, color_of: dict[str, str], path: Path
) -> None:
    """[Kuehn] Fig. 2 (kind "translation") or 3 ("orientation"): shares of updates per class.

    Beside the paper's classes of 0.025 m or 0.05 rad the same errors as cumulative shares on a
    logarithmic scale: good algorithms never leave the first class. `limit` is the mean error of two
    fixes at the Cramer-Rao bound. Writes `path` with the endings png and pdf.
    """
    width, unit = (TRANSLATION_CLASS, "m") if kind == "translation" else (ORIENTATION_CLASS, "rad")
    figure = Figure(figsize=(11, 4), layout="constrained")
    bars, curves = figure.subplots(1, 2)
    edges = width * np.arange(CLASSES)
    thickness = 0.8 * width / max(len(errors), 1)
    for k, (name, values) in enumerate(errors.items()):
        color, (line, hatch) = color_of[name], AGAIN[k // len(COLORS) % len(AGAIN)]
        middle = edges + (k + 0.5) * thickness + 0.1 * width
        shares = class_shares(values, width, CLASSES)
        bars.bar(middle, shares, thickness, color=color, hatch=hatch, label=name)
        ordered, below = np.sort(values) * 1e3, (np.arange(len(values)) + 1) / len(values)
        curves.plot(np.maximum(ordered, 1e-3), below, color=color, linestyle=line, label=name)
    bars.set_xticks(edges, [f"{edge:g}" for edge in edges[:-1]] + [f"≥ {edges[-1]:g}"])
    classes = f"error of {kind} per update, classes of {width:g} {unit}"
    bars.set(xlabel=classes, ylabel="relative frequency", ylim=(0, 1))
    small = f"error of {kind} per update [m{unit}]"
    curves.set(xscale="log", xlabel=small, ylabel="share of updates below", ylim=(0, 1))
    if limit:
        curves.axvline(limit * 1e3, color="0.3", linestyle=":", label="Cramer-Rao bound, mean")
    curves.grid(visible=True, which="both", alpha=0.25)
    curves.legend(loc="upper left", fontsize=8)
    _save(figure, path)


def maps(
    grids: dict[str, tuple[OccupancyGrid, Pose2]],
    paths: dict[str, Floats],
    truth: Floats | None,
    color_of: dict[str, str],
    path: Path,
) -> None:
    """[Kuehn] Fig. 4: the maps side by side, each with its path; the true path dashed.

    grids with the pose of the first scan in each one's frame; paths (n, 3) and truth (m, 3) seen
    from that pose. Writes `path` with the endings png and pdf.
    """
    columns = min(3 if len(grids) <= FEW else 4, len(grids))
    rows = -(-len(grids) // columns)
    figure = Figure(figsize=(4.4 * columns, 4.4 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for axes in panels[len(grids) :]:
        axes.set_visible(False)
    for axes, (name, (grid, frame)) in zip(panels, grids.items(), strict=False):
        _draw_map(axes, grid, frame.inverse())
        if truth is not None:
            axes.plot(truth[:, 0], truth[:, 1], color="0.4", linewidth=0.8, linestyle="--")
        axes.plot(paths[name][:, 0], paths[name][:, 1], color=color_of[name], linewidth=1.0)
        axes.set_title(name)
    limits = _limits(truth if truth is not None else np.concatenate(list(paths.values())))
    panels[0].set(**limits)
    _save(figure, path)


def _draw_map(axes: Axes, grid: OccupancyGrid, moved: Pose2) -> None:
    """A map in gray, its frame laid at a pose."""
    from matplotlib.transforms import Affine2D

    place = Affine2D().rotate(moved.theta).translate(moved.x, moved.y)
    height, width = grid.p.shape
    x, y = grid.origin
    extent = (x, x + width * grid.resolution, y, y + height * grid.resolution)
    shade = np.where(np.isnan(grid.p), 0.8, 1.0 - grid.p)
    axes.imshow(
        shade,
        cmap="gray",
        vmin=0,
        vmax=1,
        origin="lower",
        extent=extent,
        interpolation="antialiased",
        transform=axes.transData if moved == IDENTITY else place + axes.transData,
    )
    axes.set_aspect("equal")
    axes.set_facecolor("0.8")


def _limits(way: Floats, margin: float = 6.0) -> dict[str, tuple[float, float]]:
    low, high = way[:, :2].min(axis=0) - margin, way[:, :2].max(axis=0) + margin
    return {"xlim": (float(low[0]), float(high[0])), "ylim": (float(low[1]), float(high[1]))}


def _save(figure: Figure, path: Path) -> None:
    """As png to look at and as pdf to print; no date inside: same figure, same bytes."""
    canvas = FigureCanvasAgg(figure)
    canvas.print_figure(path.with_suffix(".png"), dpi=110, metadata={"Software": None})
    canvas.print_figure(path.with_suffix(".pdf"), metadata={"CreationDate": None})
