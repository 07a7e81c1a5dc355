import hashlib
import pickle

import numpy as np
import pytest

from slams import load
from slams.scanlog import TimeSeries, load_npz
from slams.types import Laser, Pose2

T = np.array([0.0, 0.1, 0.2])


def arrays(**changes):
    data = {
        "format": "scanlog-1",
        "t": T,
        "ranges": np.array([[1.0, 2.0], [np.nan, np.inf], [0.05, 31.0]], np.float32),
        "angle_min": -0.5,
        "angle_increment": 1.0,
        "range_min": 0.1,
        "range_max": 30.0,
        "time_increment": 0.0,
        "mount": np.array([0.1, 0.0, 0.2]),
        "odom": np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 3.0], [2.0, 0.0, -3.0]]),
        "meta": '{"name": "three"}',
        "not_ours": np.zeros(3),
    } | changes
    return {key: value for key, value in data.items() if value is not None}


def written(tmp_path, **changes):
    path = tmp_path / "log.npz"
    np.savez_compressed(path, **arrays(**changes))
    return path


def test_load(tmp_path):
    log = load(written(tmp_path))
    assert len(log) == 3
    assert log.name == "three"
    assert log.laser == Laser(-0.5, 1.0, 2, 0.1, 30.0, Pose2(0.1, 0.0, 0.2), 0.0)
    scans = list(log)
    assert scans[1].odometry == Pose2(1.0, 0.0, 3.0)
    assert scans[0].yaw is None
    assert scans[0].ranges.dtype == np.float32


def test_beams_of_a_revolution_may_overlap(tmp_path):
    ranges = np.ones((3, 14))
    assert len(load(written(tmp_path, angle_increment=np.pi / 6, ranges=ranges))) == 3


def test_attitude_and_heights_are_read_looked_up_and_written(tmp_path):
    said = np.array([[0.0, 0.1], [0.2, 0.3], [np.nan, 0.0], [0.0, 0.0]])
    stamps = np.array([0.0, 0.2, 0.9, 1.0])
    path = written(tmp_path, attitude=said, attitude_t=stamps, mount_z=0.3, height=0.5)
    log = load(path)
    assert (log.laser.mount_z, log.laser.height, log.laser.above_floor) == (0.3, 0.5, 0.5)
    found = [scan.attitude for scan in log]
    assert found[0] == (0.0, 0.1) and found[1] == pytest.approx((0.1, 0.2))
    later = log.attitude.attitudes_at(np.array([0.5, 0.95, 1.5]))
    assert np.isnan(later).any(axis=1).all()  # in a gap, beside what is no number, behind the end
    log.save(path)
    again = load(path)
    assert again.laser == log.laser
    np.testing.assert_array_equal(again.attitude.values, said)
    by_row = load(written(tmp_path, attitude=said[:3]))
    assert [scan.attitude for scan in by_row.rows(slice(1, 3))] == [(0.2, 0.3), None]


def test_a_log_without_attitude_is_written_as_ever(tmp_path):
    path = written(tmp_path)
    log = load(path)
    log.save(path)
    with np.load(path) as file:
        assert not {"attitude", "attitude_t", "mount_z", "height"} & set(file.files)
    assert all(scan.attitude is None for scan in log)


def test_ranges_follow_rep_117_and_are_read_only(tmp_path):
    log = load(written(tmp_path))
    assert np.isnan(log.ranges[1, 0])
    assert np.isinf(log.ranges[1, 1])
    assert np.isnan(log.ranges[2, 0])  # nearer than range_min
    assert np.isinf(log.ranges[2, 1])  # beyond range_max
    with pytest.raises(ValueError, match="read-only"):
        next(iter(log)).ranges[0] = 1.0


def test_save_load_round_trip_and_equal_bytes(tmp_path):
    log = load(written(tmp_path))
    log.save(tmp_path / "a.npz")
    again = load_npz(str(tmp_path / "a.npz"))
    assert np.array_equal(again.ranges, log.ranges, equal_nan=True)
    assert np.array_equal(again.odometry_at_scans(), log.odometry_at_scans())
    assert again.meta == log.meta
    again.save(tmp_path / "b.npz")
    digests = {hashlib.sha256((tmp_path / n).read_bytes()).hexdigest() for n in ("a.npz", "b.npz")}
    assert len(digests) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.npz", "b.npz", "log.npz"]


def test_truth_is_interpolated_over_the_unwrapped_angle_and_never_extrapolated():
    track = TimeSeries(np.array([0.0, 1.0]), np.array([[0.0, 0.0, 3.0], [2.0, 4.0, -3.0]]))
    poses = track.poses_at(np.array([-0.1, 0.5, 1.0, 1.1]))
    assert np.isnan(poses[[0, 3]]).all()
    assert poses[1, :2] == pytest.approx([1.0, 2.0])
    assert abs(poses[1, 2]) == pytest.approx(np.pi)


@pytest.mark.parametrize(("period", "longest"), [(0.1, 1.0), (1.0, 5.0)])
def test_in_a_gap_of_the_truth_only_its_ends_are_known(period, longest):
    for gap in (0.99 * longest, 1.01 * longest):
        t = np.append(period * np.arange(9), 8 * period + gap)
        asked = np.array([0.5 * period, t[-2], t[-2] + 0.5 * gap, t[-1]])
        found = TimeSeries(t, np.zeros((10, 3))).known_poses_at(asked)
        assert np.isfinite(found[:, 0]).tolist() == [True, True, gap < longest, True]


def test_odometry_and_yaw_are_also_looked_up_at_the_middle_of_a_sweep(tmp_path):
    signals = {
        "odom_t": np.array([0.0, 0.06, 0.1, 0.2, 0.21]),
        "odom": np.array([[x, 0.0, 0.0] for x in (0.0, 1.0, 3.0, 4.0, 5.0)]),
        "yaw_rate": np.array([1.0, 2.0, 2.0]),
    }
    scans = list(load(written(tmp_path, time_increment=0.06, **signals)))  # two beams
    assert [scan.odometry.x for scan in scans] == pytest.approx([0.0, 3.0, 4.0])
    assert [scan.mid_odometry.x for scan in scans[:2]] == pytest.approx([0.5, 3.3])
    assert scans[1].mid_yaw - scans[1].yaw == pytest.approx(0.06)
    middle = scans[1].at_mid_sweep
    assert (middle.odometry, middle.yaw) == (scans[1].mid_odometry, scans[1].mid_yaw)
    assert middle.t == pytest.approx(0.13)
    last = scans[2]  # nothing is extrapolated
    assert (last.mid_odometry, last.at_mid_sweep.odometry) == (None, last.odometry)
    assert all(scan.at_mid_sweep is scan for scan in load(written(tmp_path, **signals)))


def test_stamps_that_jump_back_keep_the_order_and_the_rows(tmp_path):
    log = load(written(tmp_path, t=np.array([0.0, 0.3, 0.2])))
    assert log.stamp_jumps == 1
    assert [scan.t for scan in log] == [0.0, 0.3, 0.2]
    assert [scan.odometry.x for scan in log] == [0.0, 1.0, 2.0]


def test_a_log_may_begin_late(tmp_path):
    log = load(written(tmp_path, t=np.array([0.0, 0.2, 0.2]), truth=np.eye(3)))
    late = log.rows(slice(1, None))
    assert [s.t for s in late] == [0.2, 0.2]
    assert np.array_equal(late.ranges, log.ranges[1:], equal_nan=True)
    assert [s.odometry.x for s in late] == [1.0, 2.0], "row by row, though the stamps are equal"
    assert np.array_equal(late.truth_at(log.t), log.truth_at(log.t)), "the truth stays whole"
    assert late.laser is log.laser


def test_a_log_that_begins_late_keeps_tracks_of_other_rates(tmp_path):
    stamps = {"odom_t": np.array([0.0, 0.15, 0.2]), "yaw_rate_t": np.array([0.0, 0.2])}
    log = load(written(tmp_path, yaw_rate=np.array([1.0, 1.0]), **stamps))
    scans = list(log.rows(slice(1, None)))
    assert scans[0].odometry.x == pytest.approx(2.0 / 3.0)
    assert scans[1].yaw - scans[0].yaw == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"ranges": None}, "keys: got no ranges"),
        ({"t": None, "angle_min": None}, "keys: got no t, angle_min"),
        ({"format": "scanlog-9"}, "format: got scanlog-9, expected scanlog-1"),
        ({"t": np.array([0.0, np.nan, 0.2])}, "t: got stamps that are not finite"),
        ({"t": np.zeros((3, 1))}, "t: got 2 dimensions, expected 1"),
        ({"t": np.zeros(2)}, r"ranges: got \(3, 2\), expected \(2, 2\)"),
        ({"t": np.zeros(0), "ranges": np.zeros((0, 2))}, r"t: got \(0,\)"),
        ({"ranges": np.zeros(6)}, "ranges: got 1 dimensions, expected 2"),
        ({"ranges": np.zeros((3, 0))}, "at least one"),
        ({"ranges": np.array([["a", "b"]] * 3)}, "ranges: got <U1 values, expected numbers"),
        ({"angle_increment": 0.0}, "angle_increment: got 0.0"),
        ({"angle_increment": 1.0, "ranges": np.ones((3, 181))}, "got 1.0, .* a fan below 7 rad"),
        ({"range_max": 0.05}, "range_min, range_max"),
        ({"time_increment": -1.0}, "time_increment: got -1.0"),
        ({"mount": np.zeros(2)}, r"mount: got \(2,\), expected \(3,\)"),
        ({"mount": np.array([np.nan, 0, 0])}, "finite numbers"),
        ({"odom": np.zeros((2, 3))}, r"odom: got \(2, 3\), expected \(3, 3\)"),
        ({"odom": np.full((3, 3), np.inf)}, "odom: got values that are not finite"),
        ({"meta": "{"}, "meta: got other text"),
        ({"ranges": np.array([{"pickled": 1}] * 3, dtype=object)}, "allow_pickle=False"),
        ({"height": 0.0}, "height"),
        ({"height": 999.0}, "height"),
        ({"mount_z": np.nan}, "height"),
        ({"t": 1e9 * (1.7e9 + T)}, "they look like nanoseconds: divide by 1e[+]09"),
        ({"t": (1e9 * (1.7e9 + T)).astype(np.int64)}, "they look like nanoseconds"),
        ({"t": 1e6 * (1.7e9 + T)}, "they look like microseconds: divide by 1e[+]06"),
        ({"t": 1e3 * (1.7e9 + T)}, "they look like milliseconds: divide by 1000"),
        ({"t": 1e9 * T}, "a scan every 1e[+]08 s, expected seconds"),
        ({"t": 1e300 * T}, "stamps as great as 2e[+]299, expected seconds"),
        ({"range_max": 1e9}, r"range_min, range_max: got \(0.1, 1000000000.0\)"),
        ({"mount": [1e9, 0.0, 0.0]}, "mount: got .*, expected at most 100 m from the base"),
        ({"mount": [0.0, 0.0, 1e300]}, "mount: got"),
        ({"angle_min": 1e300}, "angle_min: got 1e[+]300, expected radians"),
        ({"angle_increment": 1e-310}, "angle_increment: got"),
        ({"time_increment": 1e300}, "time_increment: got"),
        ({"time_increment": 99.0}, "time_increment: got 99.0, expected .* a sweep of at most 60 s"),
        ({"odom": np.full((3, 3), 1e9)}, "odom: got values as great as 1e[+]09"),
        ({"truth": np.full((3, 3), 1e300)}, "truth: got values as great as 1e[+]300"),
        ({"yaw_rate": np.full(3, -1e300)}, "yaw_rate: got values as great as 1e[+]300"),
        ({"odom_t": 1e9 * (1.7e9 + T)}, "odom_t: got stamps as great as .* nanoseconds"),
    ],
)
def test_a_bad_log_is_refused_in_one_sentence(tmp_path, changes, sentence):
    with pytest.raises(ValueError, match=sentence) as caught:
        load(written(tmp_path, **changes))
    assert "\n" not in str(caught.value)
    assert "log.npz" in str(caught.value)


def test_a_truncated_file_is_refused_wherever_it_is_cut(tmp_path):
    whole = written(tmp_path).read_bytes()
    cut = tmp_path / "cut.npz"
    for size in range(0, len(whole), 97):
        cut.write_bytes(whole[:size])
        with pytest.raises(ValueError, match=r"cut\.npz: "):
            load(cut)


def test_other_files_are_refused(tmp_path):
    path = tmp_path / "x.npz"
    path.write_bytes(pickle.dumps([1, 2, 3]))
    with pytest.raises(ValueError, match="not an npz file"):
        load(path)
    with pytest.raises(FileNotFoundError):
        load(tmp_path / "none.npz")


def test_what_cannot_be_opened_is_one_sentence(tmp_path, monkeypatch):
    with pytest.raises(IsADirectoryError) as caught:
        load_npz(tmp_path)
    assert str(caught.value) == f"{tmp_path}: is a directory; expected an npz file"
    path = written(tmp_path)

    def forbidden(*_):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(type(path), "open", forbidden)
    with pytest.raises(PermissionError) as caught:
        load_npz(path)
    assert str(caught.value) == f"{path}: permission denied; expected an npz file"
