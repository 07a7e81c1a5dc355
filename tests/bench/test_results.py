"""A comparison over several logs, and what is written of it."""

import json
import pickle
import re
from urllib.parse import unquote

import numpy as np
import pytest

from bench import results
from bench.report.tables import logs_table
from tests.bench.compared import compared
from tests.rooms import drive

STILL, BROKEN = (f"tests.bench.test_html:{name}" for name in ("Still", "Broken"))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
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
    assert next(iter(frame.index)) == "odometry"
    broken = frame.loc[BROKEN]
    assert (broken["logs"], broken["lost or failed"]) == (2, 1)
    assert np.isnan(broken["worst [mm]"])
    assert broken["worst log"] == "room"
    assert frame.loc["odometry", "mean rank"] <= frame.loc[STILL, "mean rank"]
    assert frame["mean rank"].sum() == pytest.approx(6.0), "1 + 2 + 3, those alike share"
    page = (folder / "report.html").read_text()
    assert page.count("/report.html") == 2
    assert [f">{k}-room</a>: room: " in page for k in (1, 2)] == [True, True]
    assert "odometry yes, gyro yes" in page and "none in the log" not in page
    for link in re.findall(r'href="([^"#]+)"', page):
        assert (folder / unquote(link)).is_file()
    assert (folder / "table-logs.csv").read_text().startswith("algorithm,logs,")


def test_every_figure_is_in_the_results(made):
    folder, found = made
    read = results.read_figures(folder / results.FIGURES, results.FORMAT)
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
        results.read_figures(tmp_path / "r.json", results.FORMAT)


def test_a_log_in_another_process_is_read_only_still():
    log = pickle.loads(pickle.dumps(drive(n=5)))
    assert not log.ranges.flags.writeable
    assert np.array_equal(log.ranges, drive(n=5).ranges, equal_nan=True)
