"""python -m hector.picture OUT.png: the idea of the package, drawn from its own map and match."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hector.map import LogOddsPyramid
from hector.params import HectorParams
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Floats, Laser, Pose2, Scan

if TYPE_CHECKING:
    from matplotlib.axes import Axes

VIEW = (1.55, 2.45, 0.55, 1.45)  # m, a corner of the room
OFF = Pose2(0.035, 0.025, 0.008)  # how far the drawn scan is from its pose


def draw(path: Path) -> None:
    """Draw the occupancy on the left; the lines in the cells and the residuals on the right."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rng = np.random.default_rng(1)
    laser = Laser(-np.pi, np.pi / 540, 1080, 0.1, 30.0)
    params = HectorParams()
    pyramid, scan = LogOddsPyramid(params), EndPoints(params)
    for _ in range(8):
        pyramid.insert(scan.take(_corner_scan(laser, rng), IDENTITY), IDENTITY)
    points = OFF.transform(scan.points[:2, : scan.n].T)
    figure = Figure(figsize=(10, 5), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    _occupancy(left, pyramid, points)
    _lines(right, pyramid, points)
    left.set(xlim=VIEW[:2], ylim=VIEW[2:], aspect="equal", ylabel="y [m]")
    FigureCanvasAgg(figure).print_figure(path, dpi=90)


def _corner_scan(laser: Laser, rng: np.random.Generator) -> Scan:
    """A room of 4 x 2.4 m around the laser, 1 cm of noise."""
    cos, sin = laser.directions.T
    with np.errstate(divide="ignore"):
        walls = np.minimum(2.0 / np.abs(cos), 1.2 / np.abs(sin))
    ranges = (walls + rng.normal(0.0, 0.01, len(walls))).astype(np.float32)
    ranges.flags.writeable = False
    return Scan(0.0, ranges, laser)


def _occupancy(axes: Axes, pyramid: LogOddsPyramid, points: Floats) -> None:
    grid = pyramid.grid()
    height, width = grid.p.shape
    x, y = grid.origin
    extent = (x, x + width * grid.resolution, y, y + height * grid.resolution)
    axes.imshow(
        np.where(np.isnan(grid.p), 0.6, 1.0 - grid.p),
        cmap="gray",
        vmin=0,
        vmax=1,
        origin="lower",
        extent=extent,
    )
    axes.plot(points[:, 0], points[:, 1], ".", color="#D55E00", markersize=3)
    axes.set(title="the paper: end points climb the occupancy of cells", xlabel="x [m]")


def _lines(axes: Axes, pyramid: LogOddsPyramid, points: Floats) -> None:
    surface = pyramid.lines.surface
    rows, columns = np.nonzero(surface.slot)
    for iy, ix in zip(rows, columns, strict=True):
        center = np.array([surface.x0 + ix * 0.05, surface.y0 + iy * 0.05])
        nx, ny, d, trust = surface.lines[surface.slot[iy, ix], :4].tolist()
        foot = center + (d - center @ (nx, ny)) * np.array([nx, ny])
        along = 0.025 * np.array([-ny, nx])
        ends = np.stack([foot - along, foot + along])
        axes.plot(ends[:, 0], ends[:, 1], color="#0072B2", alpha=0.3 + 0.7 * trust, linewidth=1.5)
        if abs(nx * center[0] + ny * center[1] - d) < 0.025:
            axes.arrow(
                float(foot[0]), float(foot[1]), 0.02 * nx, 0.02 * ny, color="#0072B2", width=0.001
            )
    for point in points:
        ix, iy = (np.round((point - (surface.x0, surface.y0)) / 0.05)).astype(int)
        slot = surface.slot[iy, ix]
        if slot:
            nx, ny, d, _ = surface.lines[slot, :4].tolist()
            foot = point - (nx * point[0] + ny * point[1] - d) * np.array([nx, ny])
            axes.plot(*np.stack([point, foot]).T, color="#D55E00", linewidth=0.6)
    axes.plot(points[:, 0], points[:, 1], ".", color="#D55E00", markersize=3)
    axes.set(title="ours: each cell keeps a line; the residual is a distance", xlabel="x [m]")
    ticks = np.arange(1.525, 2.5, 0.05)
    axes.set_xticks(ticks, minor=True)
    axes.set_yticks(ticks - 1.0, minor=True)
    axes.grid(visible=True, which="minor", linewidth=0.3, color="0.8")


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
