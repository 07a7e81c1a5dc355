"""CARMEN logs, their lines typed as the format says."""

import gzip
import math

import numpy as np
import pytest

import slams
from slams import convert
from slams.formats import trajectory
from slams.types import Pose2
from tests.bags import refused

# the lines of the format's documentation, with three readings more or less
FLASER = "FLASER 181 {} 1.25 2.0 0.5 1.0 2.0 0.5 100.5 host 0.25"
RAW = "RAWLASER1 0 -1.570796 3.141593 0.017453 81.920000 0.05 0 181 {} 0 100.5 host 0.25"
ROBOT = (
    "ROBOTLASER1 0 -1.570796 3.141593 0.017453 81.920000 0.05 0 181 {} {}"
    "1.25 2.0 0.5 1.0 2.0 0.5 0.1 0.2 0.57 0.37 1000000.0 100.5 host 0.25"
)
READINGS = " ".join(f"{1.0 + 0.01 * i:.2f}" for i in range(181))
HEADER = """# CARMEN Logfile
# ODOM x y theta tv rv accel
PARAM robot_use_laser on 99.0 host 0.0
PARAM robot_empty  99.0 host 0.0
"""


def written(tmp_path, *lines, name="drive.log", header=HEADER, newline="\n"):
    path = tmp_path / name
    text = header + newline.join(lines) + newline
    packed = gzip.compress(text.encode(), mtime=0) if name.endswith(".gz") else text.encode()
    path.write_bytes(packed)
    return path


@pytest.mark.parametrize("name", ["drive.log", "drive.clf", "drive.log.gz", "recording"])
def test_flaser(name, tmp_path):
    log = slams.load(written(tmp_path, FLASER.format(READINGS), name=name))
    assert log.t.tolist() == [100.5]
    assert log.ranges[0] == pytest.approx(1.0 + 0.01 * np.arange(181), abs=1e-6)
    assert log.laser.angle_min == pytest.approx(-math.pi / 2)
    assert log.laser.angle_increment == pytest.approx(math.radians(1.0))
    assert log.laser.range_max == 81.0
    mount = (0.25 * math.cos(0.5), -0.25 * math.sin(0.5), 0.0)  # the laser seen from the robot
    assert log.laser.mount == pytest.approx(mount)
    assert np.isfinite(log.ranges).all()  # the greatest reading of a short room is a wall
    assert log.odom.values.tolist() == [[1.0, 2.0, 0.5]]
    assert log.name in ("drive", "recording")
    assert log.meta["source"]["scans"] == "FLASER"


RESOLUTION, LIMIT = "PARAM laser_front_laser_resolution", "PARAM robot_front_laser_max"


@pytest.mark.parametrize(
    ("n", "header", "step", "first", "range_max"),
    [
        (360, "", 0.5, -90.0, 81.0),
        (91, "", 2.0, -90.0, 81.0),
        (401, f"{RESOLUTION} 0.25 1 h 1\n{LIMIT} 8 1 h 1\n", 0.25, -50.0, 8.0),
        (181, f"{RESOLUTION} 3.0 1 h 1\n", 1.0, -90.0, 81.0),  # of another laser
    ],
)
def test_flaser_angles_and_limit(n, header, step, first, range_max, tmp_path):
    line = f"FLASER {n} {'2.0 ' * (n - 1)}3.0 0 0 0 0 0 0 1.0 host 1.0"
    laser = slams.load(written(tmp_path, line, header=header)).laser
    assert math.degrees(laser.angle_increment) == pytest.approx(step)
    assert math.degrees(laser.angle_min) == pytest.approx(first)
    assert laser.range_max == range_max


@pytest.mark.parametrize("remissions", ["", "0 ", "2 7.0 8.0 "])
def test_robotlaser_with_and_without_remissions(remissions, tmp_path):
    log = slams.load(written(tmp_path, ROBOT.format(READINGS, remissions)))
    assert log.odom.values.tolist() == [[1.0, 2.0, 0.5]]
    assert log.laser.n_beams == 181
    assert log.laser.angle_increment == pytest.approx(math.pi / 180, abs=1e-7)
    assert log.laser.range_max == pytest.approx(81.92)
    assert log.ranges[0, -1] == pytest.approx(2.8)


@pytest.mark.parametrize(("number", "mount"), [(1, (-0.3, 0, 0)), (2, (-0.4, 0, math.pi))])
def test_rawlasers_in_front_and_behind(number, mount, tmp_path):
    offsets = "PARAM robot_frontlaser_offset -0.3 1 h 1\nPARAM robot_rearlaser_offset -0.4 1 h 1\n"
    line = RAW.format(READINGS).replace("RAWLASER1", f"RAWLASER{number}")
    assert slams.load(written(tmp_path, line, header=HEADER + offsets)).laser.mount == mount


def test_rawlaser_takes_its_odometry_from_odom_lines(tmp_path):
    odom = [f"ODOM {t - 100:.1f} 0 0.1 0 0 0 {t} host 0" for t in (100.0, 101.0)]
    header = HEADER + "PARAM robot_frontlaser_offset 0.3 1 h 1\n"
    log = slams.load(written(tmp_path, *odom, RAW.format(READINGS), header=header))
    assert log.odometry_at_scans() == pytest.approx(np.array([[0.5, 0.0, 0.1]]))
    assert log.laser.mount == (0.3, 0.0, 0.0)
    assert log.meta["source"]["odometry"] == "ODOM"


def test_one_laser_in_three_kinds_of_lines_is_read_once(tmp_path):
    lines = [ROBOT.format(READINGS, ""), FLASER.format(READINGS), RAW.format(READINGS)]
    path = written(tmp_path, *lines)
    assert len(slams.load(path)) == 1
    assert slams.load(path).meta["source"]["scans"] == "ROBOTLASER1"
    assert slams.load(path, scan_topic="FLASER").meta["source"]["scans"] == "FLASER"
    sentence = "no RLASER lines; its laser messages: FLASER (1), RAWLASER1 (1), ROBOTLASER1 (1)"
    assert sentence in refused(path, scan_topic="RLASER")
    assert "no odometry ODOM; it has ROBOTLASER1" in refused(path, odom="ODOM")
    assert slams.load(path, odom="none").odom is None


def test_several_other_lasers_leave_a_choice(tmp_path):
    lines = [RAW.format(READINGS).replace("RAWLASER1", name) for name in ("RAWLASER2", "RAWLASER3")]
    path = written(tmp_path, *lines)
    assert "2 lasers, --scan-topic picks one: RAWLASER2 (1), RAWLASER3 (1)" in refused(path)


def test_true_poses_are_the_truth(tmp_path):
    true = ["TRUEPOS 7 8 0.9 0 0 0 100.0 host 0", "TRUEPOS 9 8 0.9 0 0 0 101.0 host 0"]
    log = slams.load(written(tmp_path, *true, FLASER.format(READINGS)))
    assert log.truth_at(log.t)[0] == pytest.approx([8.0, 8.0, 0.9])
    assert slams.load(tmp_path / "drive.log", truth="none").truth is None


def test_truth_from_a_file(tmp_path):
    trajectory.write_tum(tmp_path / "t.tum", np.array([100.0, 101.0]), np.ones((2, 3)))
    log = slams.load(written(tmp_path, FLASER.format(READINGS)), truth=str(tmp_path / "t.tum"))
    assert log.truth_at(log.t)[0] == pytest.approx(np.ones(3), abs=1e-8)
    assert log.meta["source"]["truth"] == "t.tum"
    assert log.notes == ()
    trajectory.write_tum(tmp_path / "far.tum", np.array([0.0, 1.0]), np.ones((2, 3)))
    log = slams.load(tmp_path / "drive.log", truth=str(tmp_path / "far.tum"))
    assert log.notes[0].startswith("the truth covers 0 of 1 scans: 0.000 to 1.000 s, the scans 1")
    assert log.meta["notes"] == list(log.notes)


def test_options_that_say_nothing_about_a_log_are_told(tmp_path):
    path = written(tmp_path, FLASER.format(READINGS))
    log = slams.load(path, imu="/imu", base_frame="base", scan_topic="FLASER", odom="FLASER")
    assert log.notes == ("--imu, --base-frame: nothing to choose in a CARMEN log",)
    assert slams.load(path, imu="none").notes == ()


def test_the_reading_that_means_nothing_seen(tmp_path):
    row = ["81.91"] * 60 + [f"{1.0 + 0.1 * i:.2f}" for i in range(121)]
    log = slams.load(written(tmp_path, ROBOT.format(" ".join(row), "")))
    assert np.isinf(log.ranges[0, :60]).all()
    assert np.isfinite(log.ranges[0, 60:]).all()


def test_poses_of_another_slam_are_no_mount(tmp_path):
    lines = [
        f"FLASER 181 {READINGS} {x} 0 0 {x + dx} 0 0 {x}.0 host 0"
        for x, dx in ((0, 0), (1, 0.1), (2, 0.3), (3, 0.2))
    ]
    log = slams.load(written(tmp_path, *lines, "NEFF 30"))
    assert log.laser.mount == (0.0, 0.0, 0.0)
    assert "NEFF lines: the poses of this log are the result of another SLAM" in log.notes
    note = "laser and robot poses do not move together; the laser is taken at the robot"
    assert note in log.notes


def test_the_order_of_the_file_rules(tmp_path):
    lines = [FLASER.format(READINGS).replace("100.5", t) for t in ("3.0", "1.0", "2.0")]
    log = slams.load(written(tmp_path, *lines))
    assert log.t.tolist() == [3.0, 1.0, 2.0]
    assert log.stamp_jumps == 1


@pytest.mark.parametrize("packed", [False, True])
def test_windows_line_ends_and_logs_packed_in_pieces(packed, tmp_path):
    name = "drive.log.gz" if packed else "drive.log"
    path = written(tmp_path, FLASER.format(READINGS), name=name, newline="\r\n")
    path.write_bytes(path.read_bytes() * 2)
    assert len(slams.load(path)) == 2


HALVES = {
    "readings": FLASER.format(READINGS)[:400],
    "count": "FLASER 18",
    "no number": FLASER.format(READINGS).replace("2.80", "2.8x"),
    "not finite": FLASER.format(READINGS).replace(" 1.25 ", " nan "),
    "name only": "FLASER",
    "negative": FLASER.format(READINGS).replace("181", "-1"),
    "odometry": "ODOM 1 2",
}


@pytest.mark.parametrize("kind", HALVES)
def test_a_line_cut_in_half_is_refused_or_left_out(kind, tmp_path, capsys):
    path = written(tmp_path, FLASER.format(READINGS), HALVES[kind], FLASER.format(READINGS))
    out = tmp_path / "o.npz"
    assert convert.main([str(path), str(out)]) == 2
    word = HALVES[kind].split()[0]
    sentence = f"{path}: line 6 ({word}) is incomplete; --salvage leaves such lines out\n"
    assert capsys.readouterr().err == f"slams convert: {sentence}"
    assert not out.exists()
    assert convert.main([str(path), str(out), "--salvage"]) == 0
    assert "note: 1 lines are incomplete and left out" in capsys.readouterr().err
    assert len(slams.load(out)) == 2


def test_no_laser_lines(tmp_path):
    path = written(tmp_path, "ODOM 1 2 3 0 0 0 1.0 host 1.0")
    assert "no laser lines; expected FLASER, RAWLASER1 or ROBOTLASER1" in refused(path)
    path = written(tmp_path, "FLASER 3 1")
    assert "line 5 (FLASER) is incomplete" in refused(path)
    assert "no FLASER line is complete" in refused(path, salvage=True)
    path = written(tmp_path, ROBOT.format(READINGS, "3 7.0 8.0 "))  # a remission is missing
    assert "line 5 (ROBOTLASER1) is incomplete" in refused(path)


@pytest.mark.parametrize("damage", ["cut", "corrupt"])
def test_packed_logs_that_are_not_whole(damage, tmp_path):
    rng = np.random.default_rng(0)
    rows = (" ".join(f"{r:.2f}" for r in rng.uniform(1, 9, 181)) for _ in range(200))
    path = written(tmp_path, *map(FLASER.format, rows), name="drive.log.gz")
    data = bytearray(path.read_bytes())
    half = len(data) // 2
    if damage == "cut":
        data = data[:half]
    else:
        data[half : half + 200] = b"\xff" * 200
    path.write_bytes(bytes(data))
    assert "; copy it again, or unpack the undamaged part by zcat" in refused(path, salvage=True)


def test_other_text_is_refused(tmp_path):
    texts = {"a.log": "", "b.log": "hello\n", "c.dat": "1 2 3\n", "d.log": "<html>"}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        assert "not an npz file, a ROS bag or a CARMEN log" in refused(tmp_path / name)


def test_the_mount_is_what_most_lines_agree_on(tmp_path):
    lines = []
    for k in range(9):
        robot = Pose2(0.1 * k, 0.0, 0.02 * k)
        mount = Pose2(0.9, 0.0, 0.0) if k in (0, 5) else Pose2(0.2, 0.0, 0.0)
        laser = robot @ mount
        numbers = " ".join(f"{v:.6f}" for v in (*laser, *robot))
        lines.append(f"FLASER 3 1.0 1.1 1.2 {numbers} {k}.0 host {k}.0")
    path = tmp_path / "odd.log"
    path.write_text("\n".join(lines) + "\n")
    log = slams.load(path)
    assert log.laser.mount == pytest.approx(Pose2(0.2, 0.0, 0.0), abs=1e-5)
    assert not any("do not move together" in note for note in log.notes)


def test_the_csail_log(shared_data):
    log = slams.load(shared_data("data/csail/mit-csail.log.gz"))
    known = slams.load(shared_data("data/csail/mit-csail.npz"))
    assert log.ranges.shape == (1988, 361)
    assert np.array_equal(log.ranges, known.ranges, equal_nan=True)
    assert np.array_equal(log.t, known.t)
    first = slams.Pose2(*log.odom.values[0])
    last = first.between(slams.Pose2(*log.odom.values[-1]))
    assert last == pytest.approx(known.odom.values[-1], abs=1e-9)
