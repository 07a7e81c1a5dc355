"""python -m crsm.picture OUT.png: the critical rays of a scan, and where the search brings them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from crsm.map import GreyMap
from crsm.matcher import Matcher
from crsm.params import CrsmParams
from crsm.scan import ScanReader
from slams.frontend.motion_filter import Prediction
from slams.test_world import scan_at
from slams.types import IDENTITY, Floats, Laser, Pose2

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# walls as segments x0, y0, x1, y1 [m]: a corridor, its far end, a door and a box
WALLS = np.array(
    [
        (-3, -1, 5, -1), (5, -1, 5, 1), (5, 1, 1.4, 1), (0.5, 1, -3, 1), (-3, 1, -3, -1),
        (1.4, 1, 1.4, 2.5), (1.4, 2.5, 0.5, 2.5), (0.5, 2.5, 0.5, 1),
        (2.5, -1, 2.5, -0.6), (2.5, -0.6, 2.9, -0.6), (2.9, -0.6, 2.9, -1),
    ],
    float,
)  # fmt: skip
LASER = Laser(-2.35, 4.7 / 720, 721, 0.1, 30.0)
OFF = Pose2(0.38, -0.36, 0.5)  # how far the search starts from the truth
VIEW = (-1.5, 5.4, -1.6, 2.9)  # m
COUNT = 60
DOUBT = 0.3  # m, rad: deviation of what is expected


def draw(path: Path) -> None:
    """Draw the rays on the left; the darkness of the map under their ends on the right."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    params = CrsmParams(critical_rays=COUNT)
    view, grid = ScanReader(params), GreyMap(params)
    for seed in (1, 2):
        view.take(scan_at(IDENTITY, LASER, WALLS, 0.01, np.random.default_rng(seed)), IDENTITY)
        grid.insert(view, IDENTITY)
    figure = Figure(figsize=(12, 4.7), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    _rays(left, view)
    _search(right, view, grid)
    left.set(xlim=VIEW[:2], ylim=VIEW[2:], aspect="equal", ylabel="y [m]")
    FigureCanvasAgg(figure).print_figure(path, dpi=80)


def _rays(axes: Axes, view: ScanReader) -> None:
    points = view.points[:2, : view.n].T
    for x, y in view.ends:
        axes.plot([0, x], [0, y], color="#D55E00", linewidth=0.6)
    axes.plot(points[:, 0], points[:, 1], ".", color="0.45", markersize=2)
    axes.plot(*view.ends.T, ".", color="#D55E00", markersize=6)
    axes.plot(0, 0, "o", color="black")
    title = f"{len(view.ends)} critical rays of {view.n} beams: more where few beams fix the pose"
    axes.set(title=title, xlabel="x [m]")


def _search(axes: Axes, view: ScanReader, grid: GreyMap) -> None:
    matcher = Matcher(CrsmParams(critical_rays=COUNT), grid)
    matcher.usual = 1.0  # restarts until the best
    prior = Prediction(OFF, np.eye(3) / DOUBT**2, np.eye(3) * DOUBT**2, IDENTITY, 0.0)
    best = matcher.climb(view, OFF, prior)
    shown = grid.grid()
    dark = np.nan_to_num(2.0 * shown.p - 1.0).clip(0.0)
    (x, y), (rows, columns), step = shown.origin, dark.shape, shown.resolution
    extent = (x, x + columns * step, y, y + rows * step)
    axes.imshow(dark, cmap="gray_r", origin="lower", extent=extent)
    for at, color, name in ((OFF, "#0072B2", "start"), (best.pose, "#D55E00", "found")):
        at_ends: Floats = at.transform(view.ends)
        axes.plot(*at_ends.T, ".", color=color, markersize=4, label=name)
    title = f"fitness = darkness under their ends: {best.share:.2f}, {matcher.restarts} restarts"
    axes.set(title=title, xlabel="x [m]")
    axes.legend(loc="upper left")


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
