"""The soak, scaled down: figures of long runs, and the command."""

import json

import numpy as np
import pytest

from bench import soak
from bench.report.soak_tables import as_markdown
from bench.run import soaking
from slams.baselines import Odometry
from slams.registry import find
from tests.rooms import drive


class Hoarding(Odometry):
    """Every scan takes longer and keeps a megabyte."""

    def update(self, scan):
        self.kept = [*getattr(self, "kept", []), np.ones(125_000)]
        for _ in range(400 * len(self.kept)):
            pass
        return super().update(scan)


def test_at_rest_the_stamps_go_on_and_the_scans_differ_by_noise():
    scans = list(soaking.at_rest(20))
    assert [scan.t for scan in scans] == pytest.approx(0.1 * np.arange(20))
    seen = np.array([scan.ranges for scan in scans])
    assert 0.008 < seen.std(axis=0).mean() < 0.012
    np.testing.assert_array_equal(scans[7].ranges, list(soaking.at_rest(8))[7].ranges)


def test_what_grows_is_seen_at_rest():
    found = soaking.rest("tests.bench.test_soak:Hoarding", 200)
    assert found["last_mb"] > found["first_mb"] + 50.0
    assert found["last_ms"] > 2.0 * found["first_ms"]
    assert found["off_m"] == 0.0


def test_the_time_is_that_of_the_stretch_before():
    driven = np.arange(0.0, 1000.0, 10.0)
    seconds = np.where(driven <= 500.0, 0.001, 0.003)
    assert soaking._mean_ms(seconds, driven, 500.0) == pytest.approx(1.0)
    assert soaking._mean_ms(seconds, driven, 1000.0) == pytest.approx(3.0)


def test_a_way_has_its_error_its_area_and_its_memory():
    log = drive(n=60)
    found = soaking.way("odometry", log)
    entry = find("odometry")
    slam = entry.cls(entry.params())
    for scan in log:
        slam.update(scan)
    grid = slam.map()
    assert found["seen_m2"] == pytest.approx(np.isfinite(grid.p).sum() * grid.resolution**2)
    assert 0.0 < found["ate_m"] < 0.1
    assert found["early_ms"] > 0.0 < found["late_ms"]
    assert found["scans"] == 60


def test_the_command_prints_and_writes_a_tiny_soak(tmp_path, capsys):
    words = ["--algorithms", "odometry", "tests.bench.test_soak:Hoarding", "--rest", "150"]
    words += ["--length", "3", "--size", "20", "--jobs", "1", "--out", str(tmp_path / "out")]
    assert soak.main(words) == 0
    said = capsys.readouterr().out
    assert "At rest: CPU time of a scan" in said
    assert "A long way (office-rplidar-a1-0)" in said
    found = json.loads((tmp_path / "out" / "soak.json").read_text())
    assert [row["algorithm"] for row in found["rest"]] == [
        "odometry",
        "tests.bench.test_soak:Hoarding",
    ]
    assert found["way"][0]["way_m"] == pytest.approx(3.0, abs=0.5)
    assert (tmp_path / "out" / "soak.md").read_text() == as_markdown(found)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out"]


def test_what_was_done_is_not_done_again(tmp_path, capsys):
    words = ["--algorithms", "odometry", "--rest", "150", "--length", "0", "--jobs", "1"]
    words += ["--out", str(tmp_path / "out")]
    assert soak.main(words) == 0
    first = (tmp_path / "out" / "soak.json").read_bytes()
    assert "kept" not in capsys.readouterr().err
    assert soak.main(words) == 0
    assert (tmp_path / "out" / "soak.json").read_bytes() == first
    assert "1 of 1 runs are kept from before" in capsys.readouterr().err
    assert soak.main([*words, "--rest", "151"]) == 0
    assert "kept" not in capsys.readouterr().err


def test_a_run_that_fails_is_told_and_the_others_count(tmp_path, capsys):
    words = ["--algorithms", "tests.bench.test_soak:Broken", "odometry", "--rest", "20"]
    words += ["--length", "0", "--jobs", "1", "--out", str(tmp_path / "out")]
    assert soak.main(words) == 1
    said = capsys.readouterr().out
    assert "tests.bench.test_soak:Broken failed: ZeroDivisionError: on purpose" in said
    assert "odometry" in said


def test_results_of_another_log_are_not_overwritten(tmp_path, capsys):
    for name, n in (("one", 30), ("two", 40)):
        log = drive(n=n)
        type(log)(log.t, log.ranges, log.laser, log.odom, log.truth, None, {"name": name}).save(
            tmp_path / f"{name}.npz"
        )
    words = ["--algorithms", "odometry", "--rest", "0", "--jobs", "1", "-q"]
    words += ["--out", str(tmp_path / "out"), "--log"]
    assert soak.main([*words, str(tmp_path / "one.npz")]) == 0
    assert soak.main([*words, str(tmp_path / "two.npz")]) == 2
    assert "has results of one; expected another --out, or --force" in capsys.readouterr().err
    assert soak.main([*words, str(tmp_path / "two.npz"), "--force"]) == 0


class Broken(Odometry):
    """Raises at its first scan."""

    def update(self, scan):
        raise ZeroDivisionError("on purpose")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--rest", "-1"], "--rest: got -1, expected 0 to 1e+08"),
        (["--length", "1e9"], "--length: got 1e+09"),
        (["--algorithms", "nobody"], "unknown algorithm 'nobody'"),
        (["--log", "none.npz"], "none.npz: no such file"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(words, sentence, tmp_path, capsys):
    assert soak.main([*words, "--out", str(tmp_path / "out")]) == 2
    assert sentence in capsys.readouterr().err
