"""The figures hold as many runs as there are, and what is written of several logs."""

import json
import pickle
import re
import shutil
from urllib.parse import unquote

import numpy as np
import pytest
from matplotlib.figure import Figure

from bench import results
from bench.report import figures, outputs, palette
from bench.report.html import document
from bench.report.pareto import Point
from bench.report.tables import OVER_LOGS_TITLE, logs_table
from bench.report.text import terminal
from slams import OccupancyGrid, Pose2
from tests.bench.compared import compared
from tests.rooms import drive


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
    plans = dict.fromkeys(names, figures.Plan(grid, pose, way))
    figures.save_maps(plans, way, palette.looks(names), "nowhere")
    shape = drawn[0].axes[0].get_gridspec()
    assert (shape.ncols, shape.nrows) == (columns, rows)
    assert [axes.get_title() for axes in drawn[0].axes if axes.get_visible()] == names


def test_ten_runs_have_ten_colors_and_the_bars_are_not_all_in_the_first_class(drawn):
    names = [f"run {k}" for k in range(10)]
    errors = {name: np.linspace(0.0001, 0.001, 50) for name in names}
    figures.save_histogram(errors, "translation", 0.025, palette.looks(names), "nowhere")
    (bars,) = drawn[0].axes
    assert len({box[0].get_facecolor() for box in bars.containers}) == len(names)
    assert max(bar.get_height() for box in bars.containers for bar in box) < 0.5
    ticks = [text.get_text() for text in bars.get_xticklabels()]
    assert ticks[:2] == ["0", "0.2"]
    assert ticks[-1].startswith("≥ ")


def test_an_algorithm_has_its_look_in_every_figure_and_variants_have_others():
    found = palette.looks(["x:y", "tsd", "hector@paper", "hector"])
    assert palette.looks(["hector", "crsm"])["hector"] == found["hector"]
    assert len({look.color for look in found.values()}) == 4


@pytest.mark.parametrize(
    ("reach", "most", "width"), [(0.0007, 0.025, 0.0001), (0.007, 0.025, 0.001), (9.0, 0.05, 0.05)]
)
def test_classes_are_round_and_never_wider_than_the_papers(reach, most, width):
    assert figures.class_width([np.full(10, reach)] * 3, most) == pytest.approx(width)


@pytest.mark.parametrize("step", [0.02, 0.1, 0.4])
def test_a_name_covers_no_point_and_no_other_name(drawn, step):
    """A cloud, a row and a column of points of the ten names of the default comparison."""
    names = [f"gmapping@paper {k}" for k in range(10)]
    way = np.random.default_rng(0).uniform(0.0, 1.0, (10, 2))
    for at in (way, way * (1.0, 0.0), way * (0.0, 1.0)):
        points = [Point(n, *10.0 ** (step * 10 * a), False) for n, a in zip(names, at, strict=True)]
        figures.save_overview({}, "", points, palette.looks(names), "nowhere")
        (axes,) = drawn[-1].axes
        assert sorted(text.get_text() for text in axes.texts) == names
        drawn[-1].draw_without_rendering()
        places = axes.transData.transform([(p.cpu_ms, p.error_mm) for p in points])
        boxes = [text.get_window_extent() for text in axes.texts]
        for box in boxes:
            assert not any(box.contains(*place) for place in places)
            assert box.count_overlaps(boxes) == 1, "itself"


def axes():
    return Figure().subplots()


def test_a_curve_is_where_its_numbers_are_and_a_failed_run_is_never_below():
    drawn, errors = axes(), np.array([3.0, 1.0, np.inf, 2.0])
    figures.shares_below(drawn, {"a": errors}, "error", palette.looks(["a"]))
    x, y = drawn.lines[0].get_data()
    assert x.tolist() == [1.0, 2.0, 3.0]
    assert y.tolist() == [0.25, 0.5, 0.75]


def test_a_map_is_moved_into_the_frame_of_the_runs():
    p = np.full((10, 20), np.nan, np.float32)
    p[4, 6] = 1.0
    grid, start = OccupancyGrid(p, 0.5, (-1.0, 2.0)), Pose2(3.0, -2.0, 0.7)
    drawn, limits = axes(), ((-10.0, 10.0), (-10.0, 10.0))
    figures.map_panel(drawn, "true", figures.Plan(grid, start, None), None, limits, None)
    (image,) = drawn.images
    assert image.get_extent() == [-1.0, 9.0, 2.0, 7.0]
    to_data = image.get_transform() - drawn.transData
    assert to_data.transform((3.0, -2.0)) == pytest.approx([0.0, 0.0], abs=1e-9)
    shades = np.asarray(image.get_array())
    assert (shades[4, 6], shades[0, 0]) == (0.0, pytest.approx(palette.UNKNOWN_SHADE))
    assert (drawn.get_xlim(), drawn.get_ylim()) == limits


def test_the_shown_part_holds_the_paths_but_not_one_that_left_the_place():
    way = np.array([[0.0, 0.0, 0.0], [4.0, 2.0, 0.0]])
    assert figures.limits_of([way, way, 1e3 * way], 1.0) == ((-1.0, 5.0), (-1.0, 3.0))
    assert figures.limits_of([1e3 * way], 0.0) == ((0.0, 4000.0), (0.0, 2000.0))


STILL, BROKEN = (f"tests.bench.test_html:{name}" for name in ("Still", "Broken"))


@pytest.fixture(scope="module")
def made(tmp_path_factory, here):
    """The folder of two logs, one of whose runs fails, and the comparison."""
    place = tmp_path_factory.mktemp("results")
    for name, n in (("long", 60), ("short", 12)):
        drive(n=n).save(place / f"{name}.npz")
    logs = [str(place / f"{name}.npz") for name in ("long", "short")]
    names = ["odometry", STILL, BROKEN]
    words = [*logs, "--algorithms", *names, "--out", str(place / "out"), "-q", "--jobs", "1"]
    return place / "out", compared(words)


def test_several_logs_get_one_table_and_one_page(made):
    folder, found = made
    frame = logs_table(found)
    broken = frame.loc[BROKEN]
    assert (frame.index[0], broken["logs"], broken["lost or failed"]) == ("odometry", 2, 1)
    assert np.isnan(broken["worst [mm]"]) and broken["worst log"] == "room"
    assert OVER_LOGS_TITLE in terminal(found)
    assert f"{BROKEN} failed: ValueError: no <b>walls</b>" in terminal(found)
    assert frame.loc["odometry", "mean rank"] <= frame.loc[STILL, "mean rank"]
    assert frame["mean rank"].sum() == pytest.approx(6.0), "1 + 2 + 3, those alike share"
    page = (folder / "report.html").read_text()
    assert page.count("/report.html") == 2
    assert [f">{k}-room</a>: room: " in page for k in (1, 2)] == [True, True]
    for link in re.findall(r'href="([^"#]+)"', page):
        assert (folder / unquote(link)).is_file()
    assert (folder / "table-logs.csv").read_text().startswith("algorithm,logs,")
    other = found.logs[0]._replace(reference=results.Reference({"name": "a/b"}))
    assert outputs.place_of(folder, found._replace(logs=[other] * 2), 1) == folder / "2-a-b"
    names = {path.name for path in (folder / "2-room").iterdir()}
    assert {"report.html", "tables.md", "errors-odometry.csv"} <= names


def test_what_is_significant_over_the_logs_is_on_their_page(made, tmp_path):
    folder, found = made
    shutil.copy(folder / "fig_errors.png", tmp_path)
    said = found._replace(over_logs=[{"sentence": "odometry is more accurate"}])
    document.write_joint(tmp_path, said, ["1-room", "2-room"])
    assert "odometry is more accurate" in (tmp_path / "report.html").read_text()


def test_every_figure_is_in_the_results(made):
    folder, found = made
    read = results.read_figures(folder / results.RESULTS_FILE, results.RESULTS_FORMAT)
    assert [log["name"] for log in read["logs"]] == ["room", "room"]
    assert [row["algorithm"] for row in read["rows"]] == 2 * ["odometry", STILL, BROKEN]
    assert read["rows"][0]["errors"] == found.rows[0]["errors"]
    assert read["over_logs"] == json.loads(json.dumps(found.over_logs))
    assert set(found.logs[0].outcomes[0].errors) == {"update", "0.1 s", "1 s", "1 m"}


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"{", "damaged"),
        (b"[]", "expected an object"),
        (json.dumps({"format": "results-2", "logs": []}).encode(), "another"),
    ],
)
def test_damaged_results_are_refused(tmp_path, content, sentence):
    (tmp_path / "r.json").write_bytes(content)
    with pytest.raises(ValueError, match=sentence):
        results.read_figures(tmp_path / "r.json", results.RESULTS_FORMAT)


def test_a_log_in_another_process_is_read_only_still():
    log = pickle.loads(pickle.dumps(drive(n=5)))
    assert not log.ranges.flags.writeable
    assert np.array_equal(log.ranges, drive(n=5).ranges, equal_nan=True)


def test_thin_walls_survive_in_large_maps_and_unknown_stays_unknown():
    p = np.full((10, 2500), 0.1, np.float32)
    p[:, 1201], p[:, :300] = 1.0, np.nan
    joined = figures._joined(p)
    assert joined.shape == (4, 834)
    assert (joined[:, 1201 // 3] == 1.0).all()
    assert np.isnan(joined[:, :100]).all() and not np.isnan(joined[:, 100:]).any()
