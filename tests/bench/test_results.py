"""Results are typed, complete, and enough to draw everything again."""

import filecmp
import json
import re
from urllib.parse import unquote

import numpy as np
import pytest

from bench import compare, results
from bench.report import __main__ as again
from bench.report.tables import logs_table
from tests.rooms import drive


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A comparison of two logs, one of whose runs fails."""
    place = tmp_path_factory.mktemp("results")
    for name, n in (("long", 60), ("short", 12)):
        drive(n=n).save(place / f"{name}.npz")
    logs = [str(place / f"{name}.npz") for name in ("long", "short")]
    names = ["odometry", "tests.bench.test_html:Still", "tests.bench.test_html:Broken"]
    arguments = [*logs, "--algorithms", *names, "--out", str(place / "out"), "-q", "--jobs", "1"]
    assert compare.main(arguments) == 0
    return place / "out"


def test_everything_is_drawn_again_without_a_run(folder, tmp_path, capsys):
    copy = tmp_path / "copy"
    copy.mkdir()
    for name in (results.FIGURES, results.ARRAYS):
        (copy / name).write_bytes((folder / name).read_bytes())
    assert again.main([str(copy)]) == 0
    assert "Over all logs:" in capsys.readouterr().out
    made = sorted(p.relative_to(folder) for p in folder.rglob("*") if p.is_file())
    assert len(made) > 40
    (copy / "table-old.csv").touch()
    assert again.main([str(copy), "-q"]) == 0
    assert made == sorted(p.relative_to(copy) for p in copy.rglob("*") if p.is_file())
    assert [p for p in made if not filecmp.cmp(folder / p, copy / p, shallow=False)] == []


def test_several_logs_get_one_table_and_one_page(folder, tmp_path):
    found = results.read(folder)
    frame = logs_table(found)
    assert next(iter(frame.index)) == "odometry"
    broken = frame.loc["tests.bench.test_html:Broken"]
    assert (broken["logs"], broken["lost or failed"]) == (2, 1)
    assert np.isnan(broken["worst [mm]"])
    assert broken["worst log"] == "room"
    assert (
        frame.loc["odometry", "mean rank"] <= frame.loc["tests.bench.test_html:Still", "mean rank"]
    )
    ranks = frame["mean rank"]
    assert ranks.sum() == pytest.approx(6.0), "1 + 2 + 3, those alike share"
    page = (folder / "report.html").read_text()
    assert page.count("/report.html") == 2
    assert [f">{k}-room</a>: room: " in page for k in (1, 2)] == [True, True]
    assert "odometry yes, gyro yes" in page and "none in the log" not in page
    for link in re.findall(r'href="([^"#]+)"', page):
        assert (folder / unquote(link)).is_file()
    assert (folder / "table-logs.csv").read_text().startswith("algorithm,logs,")


def test_what_is_read_is_what_was_saved(folder, tmp_path):
    found = results.read(folder)
    assert [log.entry["name"] for log in found.logs] == ["room", "room"]
    assert [len(log.outcomes) for log in found.logs] == [3, 3]
    first, _, broken = found.logs[0].outcomes
    assert len(first.t) == len(first.poses) == len(first.seconds) == 60
    assert first.grid is not None
    assert first.grid.resolution == 0.05
    assert first.row["used"] == ["wheels"]
    assert set(first.errors) == {"update", "0.1 s", "1 s", "1 m"}
    assert broken.row["failed"] is None or "no hope" in broken.row["failed"]
    results.save(tmp_path, found)
    for name in (results.FIGURES, results.ARRAYS):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


def test_a_foreign_frame_survives(tmp_path):
    from bench.results import Comparison, LogResult, Outcome, Reference
    from slams import Pose2

    outcome = Outcome({"algorithm": "a", "failed": None}, frame=Pose2(1.0, 2.0, 0.5))
    results.save(tmp_path, Comparison({}, [LogResult(Reference({"name": "l"}), [outcome])], []))
    assert results.read(tmp_path).logs[0].outcomes[0].frame == Pose2(1.0, 2.0, 0.5)


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        (results.FIGURES, b"{", "damaged"),
        (results.FIGURES, b"[]", "expected an object"),
        (results.FIGURES, json.dumps({"format": "results-2", "logs": []}).encode(), "another"),
        (results.ARRAYS, b"PK\3\4 cut", "damaged"),
    ],
)
def test_damaged_results_are_refused(folder, tmp_path, capsys, name, content, sentence):
    for known in (results.FIGURES, results.ARRAYS):
        (tmp_path / known).write_bytes((folder / known).read_bytes())
    (tmp_path / name).write_bytes(content)
    before = sorted(tmp_path.iterdir())
    assert again.main([str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before


def test_a_folder_without_results_is_refused(tmp_path, capsys):
    assert again.main([str(tmp_path / "none")]) == 2
    assert "no such file" in capsys.readouterr().err


def test_a_log_in_another_process_is_read_only_still():
    import pickle

    log = pickle.loads(pickle.dumps(drive(n=5)))
    assert not log.ranges.flags.writeable
    assert np.array_equal(log.ranges, drive(n=5).ranges, equal_nan=True)
