"""python -m gmapping.picture OUT.png: particles, their histories and the tiles they share."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gmapping.map import TileMap
from gmapping.params import GMappingParams
from gmapping.particles import Particles
from gmapping.slam import GMapping
from gmapping.tile_kernels import SIDE
from slams.test_world import box, laser, scan_at
from slams.types import IDENTITY, Floats, Pose2

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PARTICLES = 12
BLUE, ORANGE = "#0072B2", "#D55E00"


def draw(path: Path) -> None:
    """Draw the tree of histories on the left; the tiles by how many maps share them, right."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    params = GMappingParams.preset("paper").replace(
        n_particles=PARTICLES, linear_update=0.5, max_range=6.0
    )
    slam = GMapping(params)
    truth = _drive(slam)
    figure = Figure(figsize=(10, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    _histories(left, slam.particles, truth)
    _tiles(right, slam.tiles)
    FigureCanvasAgg(figure).print_figure(path, dpi=90)


def _drive(slam: GMapping) -> Floats:
    """Through a corridor of 17 m with odometry that drifts; true headings at the keyframes."""
    rng = np.random.default_rng(1)
    lidar, walls = laser(360, 2.0 * np.pi, range_max=6.0), np.array(box(-1.0, -1.5, 16.0, 1.5))
    pose, odometry, inserted, headings = IDENTITY, IDENTITY, 0, []
    for k in range(300):
        step = Pose2(0.05, 0.0, 0.02 * np.sin(0.1 * k))
        if k:
            pose = pose @ step
            odometry = odometry @ Pose2(step.x * 1.05, 0.0, step.theta + rng.normal(0.001, 0.003))
        slam.update(scan_at(pose, lidar, walls, 0.03, rng, 0.1 * k, odometry))
        if slam.report()["inserted"] > inserted:
            inserted += 1
            headings.append(pose.theta)
    return np.array(headings)


def _histories(axes: Axes, particles: Particles, truth: Floats) -> None:
    before = np.zeros(len(particles))
    for k, (parents, nodes) in enumerate(particles.generations()):
        error = 1e3 * (nodes[:, 2] - truth[k])
        axes.plot([k - 1, k], np.stack([before[parents], error]), color="0.7", linewidth=1)
        if k and (parents != np.arange(len(parents))).any():
            axes.axvline(k - 0.5, color="0.6", linestyle=":")
        before = error
    for i in range(len(particles)):
        axes.plot(1e3 * (particles.history(i)[:, 2] - truth), color=BLUE, linewidth=1)
    best = particles.history(particles.best)[:, 2] - truth
    axes.plot(1e3 * best, color=ORANGE, linewidth=2)
    axes.set(xlabel="keyframe", ylabel="error of the heading [mrad]", xlim=(0, None))
    axes.set_title("histories: alive (blue), dropped by resampling (gray), best (orange)", size=9)


def _tiles(axes: Axes, tiles: TileMap) -> None:
    edge, tables = SIDE * tiles.tiles.resolution, tiles.touched
    height, width = tables.shape[:2]
    shown = np.full((height, width), np.nan)
    for ty, tx in np.argwhere(tables.any(axis=(2, 3))):
        slots = tables[ty, tx]
        slots = slots[slots > 0]
        shown[ty, tx] = len(slots) / len(np.unique(slots))
    x = (tiles.tiles.window[0] - 0.5 / SIDE) * edge
    y = (tiles.tiles.window[1] - 0.5 / SIDE) * edge
    extent = (x, x + width * edge, y, y + height * edge)
    image = axes.imshow(shown, cmap="Blues", vmin=0, origin="lower", extent=extent)
    axes.figure.colorbar(image, ax=axes, label="particles to a stored tile", shrink=0.6)
    axes.set(xlabel="x [m]", ylabel="y [m]", xlim=(-2, 17), ylim=(-3, 3))
    axes.set_title("tiles: the past is stored once, the present in every map", size=9)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
