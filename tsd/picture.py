"""python -m tsd.picture OUT.png: the field with a ray cast, and a scan before and after."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from slams.test_world import cast, scan_at
from slams.types import Floats, Laser, Pose2, Ranges
from tsd.image import colored
from tsd.params import TsdParams
from tsd.slam import Tsd

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# walls as segments x0, y0, x1, y1 [m]: a room, a plate of 3 cm and a box
WALLS = np.array(
    [
        (-2, -1.2, 2.4, -1.2), (2.4, -1.2, 2.4, 1.4), (2.4, 1.4, -2, 1.4), (-2, 1.4, -2, -1.2),
        (0.9, 0.1, 0.93, 0.1), (0.93, 0.1, 0.93, 0.9), (0.93, 0.9, 0.9, 0.9), (0.9, 0.9, 0.9, 0.1),
        (1.5, -0.7, 1.9, -0.6), (1.9, -0.6, 1.85, -0.3), (1.85, -0.3, 1.45, -0.4),
        (1.45, -0.4, 1.5, -0.7),
    ],
    float,
)  # fmt: skip
LASER = Laser(-2.35, 4.7 / 720, 721, 0.1, 30.0)
PATH = [Pose2(0.015 * i, 0.4 * math.sin(0.2 * i), 0.6 * math.sin(0.1 * i)) for i in range(40)]
RAY = -0.32  # direction of the ray shown [rad]
OFF = Pose2(0.07, -0.05, 0.06)  # where the alignment shown starts, from the pose found
VIEW = (-0.3, 2.7, -1.5, 1.7)  # m


def draw(path: Path) -> None:
    """Draw the field and the distances on one ray; a scan's residuals before and after."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rng = np.random.default_rng(1)
    slam = Tsd(TsdParams(cell=0.025, truncation=0.1))
    for i, pose in enumerate(PATH):
        found = slam.update(scan_at(pose, LASER, WALLS, 0.01, rng, 0.1 * i))
    figure = Figure(figsize=(12, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1, 1))
    _field(left, slam, PATH[0])
    _residuals(right, slam, found, scan_at(PATH[-1], LASER, WALLS, 0.01, rng).ranges)
    FigureCanvasAgg(figure).print_figure(path, dpi=75)


def _show(axes: Axes, slam: Tsd) -> None:
    tsd, _, cell, (x, y) = slam.field()
    image = colored(tsd, slam.params.truncation)[::-1, :, ::-1]
    known = np.isfinite(tsd)
    x += cell * int(np.flatnonzero(known.any(axis=0))[0])
    y += cell * int(np.flatnonzero(known.any(axis=1))[0])
    extent = (x, x + image.shape[1] * cell, y, y + image.shape[0] * cell)
    axes.imshow(image, origin="lower", extent=extent)
    axes.set(xlim=VIEW[:2], ylim=VIEW[2:], aspect="equal", xlabel="x [m]", ylabel="y [m]")


def _field(axes: Axes, slam: Tsd, start: Pose2) -> None:
    _show(axes, slam)
    reach = float(cast(WALLS, start, LASER)[round((RAY + 2.35) / (4.7 / 720))])
    end = (reach * math.cos(RAY), reach * math.sin(RAY))
    axes.plot([0, end[0]], [0, end[1]], color="black", linewidth=1)
    axes.plot(*end, "o", color="black", markersize=5)
    axes.plot(0, 0, "^", color="black")
    axes.set(title="the field: blue before a surface, red behind; a ray ends at zero")


def _residuals(axes: Axes, slam: Tsd, found: Pose2, ranges: Ranges) -> None:
    _show(axes, slam)
    points: Floats = ranges[:, None].astype(float) * LASER.directions
    for pose, color, name in ((found @ OFF, "black", "start"), (found, "#F0E442", "found")):
        ends = pose.transform(points)[::4]
        axes.plot(*ends.T, ".", color=color, markersize=4, label=name)
    axes.set(title="a scan is moved until its points lie on zero")
    axes.legend(loc="lower left")


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
