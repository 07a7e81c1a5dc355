"""Names beside the points of a figure."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import TYPE_CHECKING

from matplotlib.transforms import Bbox

from bench.report.palette import Look

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GAP = 6.0  # pt, from a point to its name, and kept free around every point
HEIGHTS = sorted(range(-60, 61, 5), key=abs)  # pt above its point, where a name is tried


def write_names(
    axes: Axes, places: Mapping[str, tuple[float, float]], looks: Mapping[str, Look]
) -> None:
    """Write the names of points in their colors, over no point and no other name.

    The last thing that is drawn: from then on the axes stay where they are.
    """
    figure = axes.figure.canvas.figure
    figure.draw_without_rendering()
    points = axes.transData.transform([*places.values()])
    taken = [Bbox([at, at]).padded(GAP * figure.dpi / 72.0) for at in points]
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
        for up, side in product(HEIGHTS, (GAP, -GAP)):
            text.xyann = side, up
            text.set(ha="left" if side > 0.0 else "right")
            box = text.get_window_extent()
            if axes.bbox.count_contains(box.corners()) == 4 and not box.count_overlaps(taken):
                break
        taken.append(box)
