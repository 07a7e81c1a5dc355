"""Logs of two lasers: the file, the runs, a laser that dies."""

from dataclasses import replace

import numpy as np
import pytest

from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from slams import info
from slams.formats.options import SourceOptions
from slams.laser_table import silent_lasers
from slams.player import replay
from slams.registry import find
from slams.scanlog import load_npz
from slams.summary import as_text, summarize, truth_errors
from tests.rooms import ALGORITHMS, made, rewritten


@pytest.fixture(scope="module")
def log():
    return simulate(Setting(size=10.0, seed=1, sensor="rplidar-a1", duration=30.0, lasers=2))


def run_of(name, log):
    return replay(made(name), log.select(odometry=False)), find(name).params()


def test_the_file_keeps_lasers_and_whose_scan_is_whose(log, tmp_path):
    log.save(tmp_path / "two.npz")
    again = load_npz(tmp_path / "two.npz")
    assert again.lasers == log.lasers and len(log.lasers) == 2
    for one, other in zip(log, again, strict=True):
        assert one.laser == other.laser and one.t == other.t
        assert np.array_equal(one.ranges, other.ranges, equal_nan=True)
    assert [scan.laser.mount.x for scan in log][:4] == [0.2, -0.2, 0.2, -0.2]
    *_, last = info.report([tmp_path / "two.npz"], SourceOptions())
    assert last == "usable by: slams run, convert"


def test_rows_of_lasers_with_fewer_beams_are_cut(log):
    narrow = replace(log.others[0], n_beams=5)
    scans = list(replace(log, others=(narrow,)))
    assert len(scans[0].ranges) == log.laser.n_beams and len(scans[1].ranges) == 5


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"laser": np.zeros(3)}, "laser: got"),
        ({"laser": None}, "no laser"),
        ({"lasers": np.zeros((2, 3))}, "lasers: got"),
        ({"lasers": np.zeros((0, 11))}, "lasers: got"),
    ],
)
def test_a_broken_table_is_one_sentence(log, tmp_path, changes, says):
    path = tmp_path / "two.npz"
    log.save(path)
    rewritten(path, path, **changes)
    with pytest.raises(ValueError, match=says):
        load_npz(path)


@pytest.mark.parametrize("name", ALGORITHMS)
def test_every_algorithm_maps_by_both_and_reports_a_rear_laser_that_fails(name, log):
    run, params = run_of(name, log)
    assert truth_errors(run, log)["ate_m"] < 0.02 and not run.says_lost.any()
    assert "sent no scan" not in as_text(summarize(run, log, name, params, 0.0))
    alive = (log.numbers == 0) | (log.t < 10.0)
    dying = log.rows(np.flatnonzero(alive))
    run, params = run_of(name, dying)
    errors = truth_errors(run, dying)
    assert errors["per_update"]["translation_m"]["max"] < 0.05
    assert errors["ate_m"] < 0.03 and not run.says_lost.any()
    text = as_text(summarize(run, dying, name, params, 0.0))
    assert "laser 1 sent no scan after 9.9 s" in text


@pytest.mark.parametrize(
    ("period", "last", "is_silent"),
    [(0.1, 16.0, True), (0.1, 18.0, False), (1.0, 12.0, False), (1.0, 8.0, True), (1.0, 0.0, True)],
)
def test_a_laser_is_silent_after_three_seconds_or_ten_of_its_intervals(period, last, is_silent):
    own = np.arange(0.0, last + 1e-6, period)
    stamps = np.concatenate([own, np.linspace(0.0, 20.0, 201)])
    found = silent_lasers(stamps, np.repeat((1, 0), (len(own), 201)), 2)
    assert [one["laser"] for one in found] == [1] * is_silent
    assert [one["last_s"] for one in found] == pytest.approx([last] * is_silent)
