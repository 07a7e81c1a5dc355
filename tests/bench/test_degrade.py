"""The catalog of degradations, and what each does to laser, readings and time."""

import dataclasses
import hashlib
import math
from functools import cache

import numpy as np
import pytest

from bench.run import trial
from bench.run.plan import conditions_of
from bench.run.store import canonical
from bench.sim.degrade import CATALOG, degrade
from slams.scanlog import ScanLog, TimeSeries
from tests.rooms import ROOM, cast, drive, drive_poses, laser


@cache
def plain(n=120, rate=20.0, n_beams=181, time_increment=0.0):
    """The room as it is: no noise, a whole angle between the beams."""
    return drive(n, rate, 0.0, lidar=laser(n_beams, time_increment=time_increment))


def content(log):
    digest = hashlib.sha256(log.t.tobytes() + log.ranges.tobytes() + repr(log.laser).encode())
    for track in (log.odom, log.truth, log.yaw_rate, log.attitude):
        if track is not None:
            digest.update(track.t.tobytes() + track.values.tobytes())
    return digest.hexdigest() + repr(log.meta)


def hard(name):
    """A level that leaves something of a log of six seconds."""
    return CATALOG[name].levels[:2][-1]


def test_levels_are_allowed_in_order_and_few():
    for name, entry in CATALOG.items():
        assert entry.name == name and entry.unit and len(entry.meaning) > 10
        levels = list(entry.levels)
        for level in (*levels, entry.low, entry.high):
            assert entry.checked(level) == level
        assert levels in (sorted(levels), sorted(levels, reverse=True))
        lone = len(levels) == 1
        assert lone == (name in ("clean", "poor_lidar"))
        assert lone or 5 <= len(levels) <= 8


@pytest.mark.parametrize("name", CATALOG)
def test_same_arguments_same_bytes_and_the_log_stays(name):
    log = plain()
    before = content(log)
    first = degrade(log, name, hard(name), 3)
    assert content(log) == before
    assert content(degrade(log, name, hard(name), 3)) == content(first)
    other = degrade(log, name, hard(name), 6)
    arrays = [dataclasses.replace(degraded, meta={}) for degraded in (first, other)]
    assert (content(arrays[0]) == content(arrays[1])) == (not CATALOG[name].random)
    assert (content(arrays[0]) == content(dataclasses.replace(log, meta={}))) == (name == "clean")


def test_clean_is_the_log_itself_and_everything_else_says_what_was_done():
    log = plain(20)
    assert degrade(log, "clean", 0, 7) is log
    twice = degrade(degrade(log, "beams", 45, 1), "noise", 0.05, 2)
    assert twice.meta["degraded"] == [
        {"name": "beams", "level": 45.0, "seed": 1},
        {"name": "noise", "level": 0.05, "seed": 2},
    ]
    assert twice.name == "room+beams=45-1+noise=0.05-2"
    assert twice.laser.n_beams == 45 and "degraded" not in log.meta


def test_draws_of_two_degradations_have_nothing_to_do_with_each_other():
    log = plain(40)
    lost = np.isfinite(degrade(log, "dropout", 50, 1).ranges)
    cut = degrade(log, "short", 50, 1).ranges < log.ranges
    assert abs(np.corrcoef(lost.ravel(), cut.ravel())[0, 1]) < 0.05


NOISE = "standard deviation of Gaussian noise added to each reading"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("noise=-1", f"noise: got -1, expected 0 to 10 m ({NOISE}), for instance 0.05, 0.1, 0.2"),
        ("noise=much", "got much, expected 0 to 10 m"),
        ("noise=nan", "got nan"),
        ("noise=", "noise: got , expected"),
        ("beams=0", "beams: got 0, expected a whole number from 1 to 100000 (beams"),
        ("people=1.5", "people: got 1.5, expected a whole number from 0 to 50 (people who"),
        ("fov=-3", "fov: got -3, expected 1 to 360 deg (field of view"),
        ("clean=1", "clean: got 1, expected 0 (the log without degradation)"),
        ("speed=0", "speed: got 0, expected 1 to 100 x"),
    ],
)
def test_levels_out_of_bounds(text, sentence):
    with pytest.raises(ValueError, match=r"expected") as refused:
        conditions_of([text])
    assert sentence in str(refused.value) and "\n" not in str(refused.value)


def test_a_log_that_has_nothing_to_spoil_is_refused():
    log = plain(5)
    bare = ScanLog(log.t, log.ranges, log.laser)
    elsewhere = dataclasses.replace(bare, truth=TimeSeries(log.t + 99.0, log.truth.values))
    for name, given, word in (
        ("slip", bare, "odometry"),
        ("gyro_bias", bare, "gyro"),
        ("people", bare, "truth at any scan"),
        ("glass", elsewhere, "truth at any scan"),
    ):
        with pytest.raises(ValueError, match=f"{name}: log has no {word}; leave {name} out"):
            degrade(given, name, hard(name), 0)
    with pytest.raises(ValueError, match="seed: got -1"):
        degrade(log, "noise", 0.1, -1)
    with pytest.raises(ValueError, match=r"range: got 0\.1 m, .* minimum range of 0\.1 m"):
        degrade(log, "range", 0.1, 0)


def odd_logs():
    log = plain(40)
    back = np.array(log.t)
    back[20:] -= 0.5
    noted = [TimeSeries(back, track.values) for track in (log.odom, log.truth, log.yaw_rate)]
    jumps = ScanLog(back, log.ranges, log.laser, *noted)
    blind = dataclasses.replace(log, ranges=np.full_like(log.ranges, np.nan))
    late = dataclasses.replace(log, truth=TimeSeries(log.t[10:], log.truth.values[10:]))
    clockwise = dataclasses.replace(log.laser, angle_increment=-0.02)
    return {
        "no odometry": log.select(odometry=False),
        "one scan": log.rows(slice(0, 1)),
        "stamps jump back": jumps,
        "one beam": plain(40, n_beams=1),
        "nothing seen": blind,
        "truth from the tenth scan on": late,
        "clockwise": dataclasses.replace(log, laser=clockwise),
    }


@pytest.mark.parametrize("kind", odd_logs())
def test_odd_logs_are_spoiled_or_refused_but_never_break(kind):
    log = odd_logs()[kind]
    for name, entry in CATALOG.items():
        one = kind == "one scan" and name == "sweep"
        if entry.lacks(log) or one:
            assert kind in ("no odometry", "one scan")
            with pytest.raises(ValueError, match=name):
                degrade(log, name, hard(name), 0)
            continue
        degraded = degrade(log, name, hard(name), 0)
        assert len(degraded) >= 1 and degraded.ranges.dtype == np.float32
        assert len(list(degraded)) == len(degraded)
        assert degraded.truth is not None and np.isfinite(degraded.truth.values).all()


def test_rate_keeps_the_scans_nearest_to_an_even_rate():
    log = plain()
    slow = degrade(log, "rate", 5, 0)
    np.testing.assert_allclose(np.diff(slow.t), 0.2)
    np.testing.assert_array_equal(slow.ranges, log.ranges[::4])
    np.testing.assert_array_equal(slow.odometry_at_scans(), log.odom.values[::4])
    assert len(degrade(log, "rate", 20, 0)) == len(degrade(log, "rate", 500, 0)) == len(log)
    uneven = degrade(log, "rate", 15, 0)
    assert len(uneven) == 90 and set(np.round(np.diff(uneven.t), 6)) == {0.05, 0.1}
    faster = dataclasses.replace(log, odom=TimeSeries(np.linspace(0, 6, 601), np.zeros((601, 3))))
    assert degrade(faster, "rate", 2, 0).odom is faster.odom


@pytest.mark.parametrize(
    ("name", "level", "left", "view"),
    [
        ("beams", 91, 91, 270.0),
        ("beams", 45, 45, 264.0),
        ("beams", 70, 61, 270.0),
        ("beams", 2, 2, 136.5),
        ("beams", 1, 1, 0.0),
        ("beams", 4000, 181, 270.0),
        ("fov", 120, 81, 120.0),
        ("fov", 101, 67, 99.0),
        ("fov", 1, 1, 0.0),
        ("fov", 360, 181, 270.0),
    ],
)
def test_what_is_left_of_the_fan_is_where_it_says(name, level, left, view):
    """Against the room itself, cast with the new laser."""
    log = plain(6)
    thin = degrade(log, name, level, 0)
    assert thin.laser.n_beams == left
    angles = np.degrees(thin.laser.angles)
    assert angles[-1] - angles[0] == pytest.approx(view, abs=1e-9)
    assert abs(angles[0] + angles[-1]) <= np.degrees(log.laser.angle_increment) + 1e-9
    for i in (0, 5):
        expected = cast(ROOM, log.truth.values[i], thin.laser)
        np.testing.assert_allclose(thin.ranges[i], expected, rtol=1e-6)


@pytest.mark.parametrize(("name", "level"), [("beams", 45), ("fov", 120)])
def test_a_sweeping_laser_keeps_the_time_of_every_beam(name, level):
    log = plain(5, time_increment=1e-4)
    thin = degrade(log, name, level, 0)
    beam = np.round((thin.laser.angles - log.laser.angle_min) / log.laser.angle_increment)
    before = log.t[:, None] + 1e-4 * beam
    after = thin.t[:, None] + thin.laser.time_increment * np.arange(thin.laser.n_beams)
    np.testing.assert_allclose(after, before, atol=1e-12)
    assert thin.t[0] > log.t[0]


def test_sweep_measures_beam_after_beam():
    """Each beam against the room at the pose of its own time, known from the formula of the way."""
    log = plain(400, rate=200.0, n_beams=91)
    turning = degrade(log, "sweep", 4, 0)
    assert turning.laser.time_increment == pytest.approx(0.75 / 4 / 90)
    np.testing.assert_allclose(np.diff(turning.t), 0.25)
    assert len(turning) == 8
    own, at_once = [], []
    for i in range(1, 8):
        for j in range(0, 91, 9):
            t = turning.t[i] + j * turning.laser.time_increment
            one = dataclasses.replace(turning.laser, angle_min=turning.laser.angles[j], n_beams=1)
            pose = drive_poses(round(t * 1000) + 1, 1e-3)[-1]
            own.append(turning.ranges[i, j] - cast(ROOM, pose, one)[0])
            at_once.append(turning.ranges[i, j] - log.ranges[round(turning.t[i] * 200), j])
    assert np.median(np.abs(own)) < 2e-3 < 10e-3 < np.median(np.abs(at_once))


def test_a_sweep_of_a_sweep_takes_the_first_ones_times_into_account():
    lidar = laser(181, time_increment=0.75 / 100 / 180)
    swept = dataclasses.replace(plain(200, rate=100.0), laser=lidar)
    turning = degrade(swept, "sweep", 10, 0)
    source = (swept.ranges == turning.ranges[3]).argmax(axis=0)
    measured = swept.t[source] + swept.laser.time_increment * np.arange(181)
    wanted = turning.t[3] + turning.laser.time_increment * np.arange(181)
    assert np.abs(measured - wanted).max() <= 0.005 + 1e-9


def test_sweep_needs_a_faster_log():
    sentence = r"sweep: 10 turns .* scans at 40 Hz or more, .* has 20 Hz"
    with pytest.raises(ValueError, match=sentence):
        degrade(plain(), "sweep", 10, 0)
    assert len(degrade(plain(), "sweep", 5, 0)) > 20


def test_range_is_cut():
    log, near = plain(20), degrade(plain(20), "range", 3, 0)
    assert near.laser.range_max == 3.0 and degrade(log, "range", 99, 0).laser.range_max == 30.0
    np.testing.assert_array_equal(np.isinf(near.ranges), log.ranges >= 3.0)
    kept = np.isfinite(near.ranges)
    np.testing.assert_array_equal(near.ranges[kept], log.ranges[kept])


def test_noise_has_its_deviation_and_no_bias():
    log = plain()
    added = degrade(log, "noise", 0.05, 0).ranges - log.ranges
    assert added.std() == pytest.approx(0.05, rel=0.02) and abs(added.mean()) < 1e-3
    assert abs(np.corrcoef(added[:-1].ravel(), added[1:].ravel())[0, 1]) < 0.03
    twice = degrade(log, "noise", 0.1, 0).ranges - log.ranges
    np.testing.assert_allclose(twice, 2.0 * added, atol=1e-5)


def test_bias_scale_and_quantization():
    log = plain(20)
    np.testing.assert_allclose(degrade(log, "bias", 0.1, 0).ranges, log.ranges + 0.1, rtol=1e-6)
    np.testing.assert_allclose(degrade(log, "scale", 5, 0).ranges, 1.05 * log.ranges, rtol=1e-6)
    steps = degrade(log, "quantization", 0.1, 0).ranges.astype(float) / 0.1
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-4)
    assert np.abs(0.1 * steps - log.ranges).max() <= 0.05 + 1e-5


def test_dropouts_are_half_inf_half_nan_and_the_same_beams_at_a_higher_level():
    log = plain()
    few, many = (degrade(log, "dropout", level, 0).ranges for level in (30, 70))
    for ranges, share in ((few, 0.15), (many, 0.35)):
        assert np.isinf(ranges).mean() == pytest.approx(share, abs=0.01)
        assert np.isnan(ranges).mean() == pytest.approx(share, abs=0.01)
    assert not np.isfinite(many[~np.isfinite(few)]).any()
    np.testing.assert_array_equal(many[np.isfinite(many)], log.ranges[np.isfinite(many)])


def test_short_readings_lie_anywhere_before_what_was_seen():
    log = plain()
    ranges = np.array(log.ranges)
    ranges[:, :10], ranges[:, 10:20] = np.inf, np.nan
    gappy = dataclasses.replace(log, ranges=ranges)
    short = degrade(gappy, "short", 30, 0).ranges
    assert np.isnan(short[:, 10:20]).all() and np.isfinite(short[:, :10]).mean() > 0.25
    seen = ranges[:, 20:]
    struck = short[:, 20:] != seen
    assert struck.mean() == pytest.approx(0.3, abs=0.01)
    share = (short[:, 20:][struck] - 0.1) / (seen[struck] - 0.1)
    assert share.min() >= 0.0 and share.max() <= 1.0
    assert share.mean() == pytest.approx(0.5, abs=0.01) and share.std() > 0.28


def test_poor_lidar_is_all_of_it():
    log = plain(80, rate=20.0, n_beams=1081)
    poor = degrade(log, "poor_lidar", 1, 0)
    assert len(poor) == 20 and poor.laser.n_beams == 360 and poor.laser.range_max == 3.5
    assert math.degrees(poor.laser.angles[-1] - poor.laser.angles[0]) == pytest.approx(269.25)
    exact = log.ranges[::4, 1:-1:3]
    near = exact < 3.0
    assert np.isnan(poor.ranges[near]).mean() == pytest.approx(0.05, abs=0.02)
    added = (poor.ranges - exact)[near & np.isfinite(poor.ranges)]
    assert added.std() == pytest.approx(0.022, rel=0.05)


@pytest.mark.parametrize("back", [0.0, 50.0])
def test_gap_and_blind_spell_last_as_long_as_they_should(back):
    """Stamps that jump back in the middle take no time."""
    log = plain()
    t = np.where(np.arange(len(log)) < 60, log.t, log.t - back)
    log = dataclasses.replace(log, t=t, odom=TimeSeries(t, log.odom.values))
    assert len(degrade(log, "rate", 5, 0)) == 30
    missing, unseen = degrade(log, "gap", 2, 5), degrade(log, "blind", 2, 5)
    assert back or np.diff(missing.t).max() == pytest.approx(2.05, abs=0.06)
    assert abs(len(log) - len(missing) - 40) <= 1
    kept = np.isin(log.t, missing.t)
    np.testing.assert_array_equal(missing.odom.t, missing.t)
    np.testing.assert_array_equal(missing.odom.values, log.odom.values[kept])
    assert kept[:20].all() and kept[-20:].all()
    dark = np.isinf(unseen.ranges).all(axis=1)
    assert len(unseen) == len(log) and abs(dark.sum() - 40) <= 1
    assert np.diff(np.flatnonzero(dark)).max() == 1
    np.testing.assert_array_equal(unseen.ranges[~dark], log.ranges[~dark])
    assert len(degrade(log, "gap", 1000, 0)) == 1 and len(degrade(log, "gap", 0, 0)) == len(log)


def test_speed_is_the_same_way_in_less_time_under_the_same_laser():
    log = plain()
    t, lidar = log.t + 100.0, dataclasses.replace(log.laser, time_increment=2e-4)
    names = ("odom", "truth", "yaw_rate")
    tracks = {name: TimeSeries(t, getattr(log, name).values) for name in names}
    roll = TimeSeries(t, np.sin(np.stack([log.t, 2.0 * log.t], axis=1)))
    late = dataclasses.replace(log, t=t, laser=lidar, attitude=roll, **tracks)
    fast = degrade(late, "speed", 2, 0)
    assert fast.t[0] == 100.0 and fast.scan_period == pytest.approx(log.scan_period)
    assert fast.laser.time_increment == 1e-4
    np.testing.assert_array_equal(fast.ranges, log.ranges[::2])
    np.testing.assert_allclose(fast.truth_at(fast.t), log.truth.values[::2], atol=1e-9)
    np.testing.assert_allclose(fast.odometry_at_scans(), log.odom.values[::2], atol=1e-9)
    np.testing.assert_allclose(fast.attitude_at_scans(), roll.values[::2], atol=1e-9)
    turned = log.yaw_rate.integral_at(log.t)[::2]
    np.testing.assert_allclose(fast.yaw_rate.integral_at(fast.t), turned, atol=1e-9)


def test_jitter_moves_stamps_and_not_the_truth_of_a_scan(monkeypatch):
    log = plain(400)
    ragged = degrade(log, "jitter", 10, 0)
    assert (ragged.t - log.t).std() == pytest.approx(0.01, rel=0.1)
    np.testing.assert_allclose(ragged.truth_at(ragged.t), log.truth.values, atol=1e-12)
    assert ragged.odom is log.odom
    off = ragged.odometry_at_scans() - log.odometry_at_scans()
    assert 1e-3 < np.nanstd(off[:, 0]) < 0.01
    assert degrade(log, "jitter", 100, 0).stamp_jumps > 50
    monkeypatch.setattr(trial, "_loaded", lambda *_: log)
    condition = canonical({"degradation": "jitter", "seed": 7, "rate": 5.0})
    for level in CATALOG["jitter"].levels:
        assert len(trial._log_of("jittered", condition, level, None)) == len(log) / 4


def test_lag_puts_the_odometry_of_later_into_a_scan():
    log = plain()
    late = degrade(log, "lag", 100, 0)
    np.testing.assert_allclose(late.truth_at(late.t), log.truth.values, atol=1e-9)
    np.testing.assert_allclose(late.odometry_at_scans()[:-2], log.odom.values[2:], atol=1e-9)
    assert np.isnan(late.odometry_at_scans()[-2:]).all()
