"""Names beside the points of a figure."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import TYPE_CHECKING

from matplotlib.transforms import Bbox

from bench.report.palette import Look

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAME_GAP = 6.0  # pt from a point to its name, and free space around every point
NAME_HEIGHTS = sorted(range(-60, 61, 5), key=abs)  # pt above the point, tried in this order


def write_names(
    axes: Axes, places: Mapping[str, tuple[float, float]], looks: Mapping[str, Look]
) -> None:
    """Write the names of points in their colors, without overlap.

    Call it last: the layout of the axes must not change afterwards.
    """
    figure = axes.figure.canvas.figure
    figure.draw_without_rendering()
    points = axes.transData.transform([*places.values()])
    taken = [Bbox([at, at]).padded(NAME_GAP * figure.dpi / 72.0) for at in points]
    for name, place in sorted(places.items(), key=lambda one: one[1]):
        text = axes.annotate(
            name,
            place,
            xytext=(0.0, 0.0),
            textcoords="offset points",
            va="center",
            fontsize=8,
            color=looks[name].color,
            parse_math=False,  # a name is no formula
        )
        for up, side in product(NAME_HEIGHTS, (NAME_GAP, -NAME_GAP)):
            text.xyann = side, up
            text.set(ha="left" if side > 0.0 else "right")
            box = text.get_window_extent()
            if axes.bbox.count_contains(box.corners()) == 4 and not box.count_overlaps(taken):
                break
        taken.append(box)
