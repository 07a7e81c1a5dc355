"""The figures hold as many runs as the default comparison has."""

import numpy as np
import pytest

from bench.report import figures
from slams import OccupancyGrid, Pose2


@pytest.fixture
def drawn(monkeypatch):
    kept = []
    monkeypatch.setattr(figures, "_save", lambda figure, path: kept.append(figure))
    return kept


@pytest.mark.parametrize(("count", "columns", "rows"), [(2, 2, 1), (6, 3, 2), (10, 4, 3)])
def test_maps_stand_in_rows_of_the_same_length(drawn, count, columns, rows):
    grid = OccupancyGrid(np.full((2, 2), 0.5, np.float32), 1.0, (0.0, 0.0))
    names = [f"run {k}" for k in range(count)]
    way = np.zeros((2, 3))
    pose = Pose2(0.0, 0.0, 0.0)
    figures.maps(
        dict.fromkeys(names, (grid, pose)),
        dict.fromkeys(names, way),
        way,
        figures.colors(names),
        "nowhere",
    )
    shape = drawn[0].axes[0].get_gridspec()
    assert (shape.ncols, shape.nrows) == (columns, rows)
    assert [axes.get_title() for axes in drawn[0].axes if axes.get_visible()] == names


def test_no_two_of_ten_runs_look_alike(drawn):
    names = [f"run {k}" for k in range(10)]
    errors = {name: np.linspace(0.001, 0.01, 5) for name in names}
    figures.histograms(errors, "translation", None, figures.colors(names), "nowhere")
    bars, curves = drawn[0].axes
    lines = [(line.get_color(), line.get_linestyle()) for line in curves.lines]
    faces = [(box[0].get_facecolor(), box[0].get_hatch()) for box in bars.containers]
    assert len(set(lines)) == len(set(faces)) == len(names)
