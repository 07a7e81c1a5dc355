"""The figures hold as many runs as the default comparison has."""

import numpy as np
import pytest

from bench.report import figures, palette
from bench.report.pareto import Point
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
        palette.colors(names),
        "nowhere",
    )
    shape = drawn[0].axes[0].get_gridspec()
    assert (shape.ncols, shape.nrows) == (columns, rows)
    assert [axes.get_title() for axes in drawn[0].axes if axes.get_visible()] == names


def test_ten_runs_have_ten_colors_and_the_bars_are_not_all_in_the_first_class(drawn):
    names = [f"run {k}" for k in range(10)]
    errors = {name: np.linspace(0.0001, 0.001, 50) for name in names}
    figures.histograms(errors, "translation", 0.025, palette.colors(names), "nowhere")
    (bars,) = drawn[0].axes
    assert len({box[0].get_facecolor() for box in bars.containers}) == len(names)
    assert max(bar.get_height() for box in bars.containers for bar in box) < 0.5


@pytest.mark.parametrize(
    ("reach", "most", "width"), [(0.0007, 0.025, 0.0001), (0.007, 0.025, 0.001), (9.0, 0.05, 0.05)]
)
def test_classes_are_round_and_never_wider_than_the_papers(reach, most, width):
    assert figures.class_width([np.full(10, reach)] * 3, most) == pytest.approx(width)


def test_the_overview_names_every_point(drawn):
    names = ["a", "b"]
    errors = {name: np.linspace(0.1, 2.0, 9) for name in names}
    points = [Point("a", 0.1, 1.0, False), Point("b", 0.2, 0.5, True)]
    figures.overview(errors, points, palette.colors(names), "nowhere")
    curves, costs = drawn[0].axes
    assert [text.get_text() for text in costs.texts] == names
    assert curves.lines[0].get_ydata()[-1] == 1.0
