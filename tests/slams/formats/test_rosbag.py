"""Bags written by the rosbags library, read as logs."""

import bz2
import gzip
import math
import os
import shutil
import sqlite3

import numpy as np
import pytest

import slams
from slams import convert, info
from slams.formats.bag import open_bag
from slams.formats.bag_salvage import salvaged
from slams.types import Pose2
from tests import bags
from tests.bags import refused

N, BEAMS = 12, 31
T = 1.6e9 + 0.1 * np.arange(N)
WAY = np.stack([0.1 * np.arange(N), 0.02 * np.arange(N), 0.05 * np.arange(N)], axis=1)
MOUNT = ("base_link", "laser", (0.2, -0.1, 0.3), 0.5, 0.0)

TRUTH_NOTE = "/ground_truth is taken as the truth (--truth none does without)"


def ranges(n=N, beams=BEAMS):
    return np.random.default_rng(0).uniform(0.5, 20.0, (n, beams)).astype(np.float32)


def each(topic, message):
    """A message at every stamp, made of the maker, its number and its stamp."""
    return lambda make: [(topic, t, message(make, i, t)) for i, t in enumerate(T)]


def fixed(*edges):
    return lambda make: [("/tf_static", T[0], make.tf(T[0], *edges))]


def together(*parts):
    return lambda make: [message for part in parts for message in part(make)]


def drive(make):
    """Scans, odometry, gyro, a true pose and the mount; received 30 ms late."""
    messages = fixed(MOUNT, ("base_link", "imu", (0, 0, 0), 0.0, 0.0))(make)
    for t, row, pose in zip(T, ranges(), WAY, strict=True):
        messages += [
            ("/scan", t + 0.03, make.scan(t, row)),
            ("/odom", t + 0.03, make.odometry(t, *pose)),
            ("/imu", t + 0.03, make.imu(t, (0.0, 0.0, 0.5))),
            ("/ground_truth", t + 0.03, make.odometry(t, *(pose + 1.0))),
            ("/rosout", t + 0.03, make.string("hello")),
        ]
    return messages


@pytest.mark.parametrize("kind", [*bags.KINDS, "db3 of Foxy"])
def test_every_storage_gives_what_was_recorded(kind, tmp_path):
    path = bags.write(tmp_path, kind.partition(" ")[0], drive)
    if kind.endswith("Foxy"):
        bags.forget_definitions(path)
    log = slams.load(path)
    assert log.t == pytest.approx(T, abs=1e-6)
    assert np.array_equal(log.ranges, ranges())
    laser = log.laser
    assert (laser.n_beams, laser.range_max) == (BEAMS, 30.0)
    assert (laser.angle_min, laser.angle_increment) == pytest.approx((-1.5, 0.1))
    assert laser.mount == pytest.approx((0.2, -0.1, 0.5))
    assert log.odometry_at_scans() == pytest.approx(WAY)
    assert log.truth_at(log.t) == pytest.approx(WAY + 1.0)
    assert log.yaw_rate.values == pytest.approx(0.5)
    assert log.name == "drive"
    assert log.meta["source"]["odometry"] == "/odom"
    assert log.notes == (TRUTH_NOTE,)


def test_the_kind_is_found_out_by_the_content(tmp_path):
    for kind in ("mcap", "db3", "bag"):
        path = bags.write(tmp_path / kind, kind, drive)
        renamed = path.rename(path.with_name("recording"))
        if kind == "bag":
            assert np.array_equal(slams.load(renamed).ranges, ranges())
        else:
            assert refused(renamed).endswith(f"is a .{kind} by its content; give it this ending")


def scans_on(*topics):
    return lambda make: [(name, t, make.scan(t, ranges()[0])) for name in topics for t in T]


@pytest.mark.parametrize("kind", ["bag", "mcap", "folder-db3"])
def test_lasers_that_are_all_asked_for_are_one_log(kind, tmp_path, capsys):
    mounts = [
        ("base_link", "front", (0.2, 0.0, 0.1), 0.0, 0.0),
        ("base_link", "rear", (-0.2, 0.0, 0.1), 3.0, 0.0),
    ]
    front = each("/front", lambda make, _, t: make.scan(t, ranges()[0], "front"))
    rear = each("/rear", lambda make, _, t: make.scan(t + 0.04, ranges()[1][:9], "rear"))
    path = bags.write(tmp_path, kind, together(fixed(*mounts), front, rear))
    log = slams.load(path, scan_topic="front", more_scan_topics=("/rear",))
    scans = list(log)
    assert [len(scan.ranges) for scan in scans] == [31, 9] * len(T)
    assert np.allclose(scans[0].laser.mount, (0.2, 0.0, 0.0))
    assert np.allclose(scans[1].laser.mount, (-0.2, 0.0, 3.0))
    assert scans[1].t == pytest.approx(T[0] + 0.04)
    assert log.meta["source"]["scans"] == "/front, /rear"
    assert "--scan-topic" in refused(path, scan_topic="/front", more_scan_topics=("front",))
    assert info.main([str(path), "--scan-topic", "/front", "--scan-topic", "/rear"]) == 0
    assert capsys.readouterr().out.count("laser: ") == 2
    assert slams.load(path, scan_topic="rear").meta["source"]["scans"] == "/rear"


wheels = each("/wheels", lambda make, i, t: make.odometry(t, *(2.0 * WAY[i])))
two_odometries = together(drive, wheels)
two_gyros = together(drive, each("/imu2", lambda make, _, t: make.imu(t, (0.0, 0.0, 0.7))))
poses = each("/mocap", lambda make, _, t: make.posed(t, 0.0, 0.0, 0.0))
mocap = together(scans_on("/scan"), poses)


def test_what_is_left_open_is_chosen(tmp_path):
    path = bags.write(tmp_path, "folder-db3", two_odometries)
    assert slams.load(path, odom="/wheels").odometry_at_scans() == pytest.approx(2 * WAY)
    assert slams.load(path, odom="none").odom is None
    path = bags.write(tmp_path / "gyros", "mcap", two_gyros)
    log = slams.load(path)
    assert log.yaw_rate is None
    assert "2 IMU topics, none is used; --imu picks one: /imu (12), /imu2 (12)" in log.notes
    assert slams.load(path, imu="/imu2").yaw_rate.values == pytest.approx(0.7)
    assert slams.load(path, imu="none").notes == log.notes[:1]
    path = bags.write(tmp_path, "bag", mocap)
    assert slams.load(path).truth is None
    assert slams.load(path, truth="/mocap").truth is not None


def tree(*static, moving=(), old=False):
    """Scans with transforms: static ones once, moving ones at each scan, as functions of i."""
    parts = [scans_on("/scan")] + ([fixed(*static)] if static else [])
    if moving:
        edges = each("/tf", lambda make, i, t: make.tf(t, *(edge(i) for edge in moving), old=old))
        parts.append(edges)
    return together(*parts)


def moves(parent, child):
    return lambda i: (parent, child, (*WAY[i, :2], 0.0), WAY[i, 2], 0.0)


@pytest.mark.parametrize("level", ["base_stabilized", "base_footprint"])
def test_without_imu_roll_and_pitch_come_from_tf(level, tmp_path):
    tilts = [lambda i: (level, "base_link", (0.0, 0.0, 0.0), 0.0, 0.01 * i), moves("odom", level)]
    wheels = each("/odom", lambda make, i, t: make.odometry(t, *WAY[i]))
    messages = together(wheels, tree(MOUNT, moving=tilts))
    for kind in ("bag", "mcap"):
        attitude = slams.load(bags.write(tmp_path, kind, messages)).attitude
        assert attitude.t == pytest.approx(T)
        assert attitude.values[:, 0] == pytest.approx(0.01 * np.arange(N), abs=1e-6)
        assert np.abs(attitude.values[:, 1]).max() < 1e-9
    still = [rests(level, "base_link", (0.0, 0.0, 0.0), 0.0, 0.1)]
    path = bags.write(tmp_path / "still", "mcap", tree(MOUNT, moving=still))
    assert slams.load(path).attitude is None


def rests(*transform):
    return lambda _: transform


CHAIN = (
    ("base_footprint", "base_link", (0.0, 0.0, 0.1), 0.0, 0.0),
    ("base_link", "mast", (1.0, 0.0, 0.5), math.pi / 2, 0.0),
    ("mast", "laser", (0.5, 0.0, 0.0), 0.1, 0.0),
)
NO_NAMES = (("a", "b", (1.0, 0.0, 0.0), 0.0, 0.0), ("b", "laser", (1.0, 0.0, 0.0), 0.0, 0.0))


@pytest.mark.parametrize(
    ("static", "base", "mount"),
    [
        (CHAIN, None, (1.0, 0.5, math.pi / 2 + 0.1)),
        (CHAIN, "mast", (0.5, 0.0, 0.1)),
        (NO_NAMES, "/a", (2.0, 0.0, 0.0)),
        (NO_NAMES[1:], None, (1.0, 0.0, 0.0)),
        (
            (MOUNT, CHAIN[1], ("base_link", "laser", (1.0, 0.0, 0.0), 0.0, 0.0)),
            None,
            (1.0, 0.0, 0.0),
        ),
    ],
)
def test_the_mount_is_a_chain_of_transforms(static, base, mount, tmp_path):
    log = slams.load(bags.write(tmp_path, "mcap", tree(*static)), base_frame=base)
    assert log.laser.mount == pytest.approx(mount)


def test_of_several_robots_the_transforms_beside_the_scans_count(tmp_path):
    def robot(name, x):
        mount = ("base_link", "laser", (x, 0.0, 0.0), 0.0, 0.0)
        way = [lambda i: ("odom", "base_link", (x * i, 0.0, 0.0), 0.0, 0.0)]
        messages = tree(mount, moving=way)
        return lambda make: [(f"/{name}{topic}", t, one) for topic, t, one in messages(make)]

    path = bags.write(tmp_path, "mcap", together(robot("r1", 0.1), robot("r2", 0.2)))
    for name, x in (("r1", 0.1), ("r2", 0.2)):
        log = slams.load(path, scan_topic=f"/{name}/scan")
        assert log.laser.mount.x == pytest.approx(x)
        assert log.odom.values[:, 0] == pytest.approx(x * np.arange(N))


LASERS = scans_on("/front", "/rear")
BOTH = {"scan_topic": "/scan", "more_scan_topics": ("/rear",)}


rear = each("/rear", lambda make, _, t: make.scan(t, ranges()[0], "rear"))
unplaced = together(tree(MOUNT), rear)


in_turn = each("/scan", lambda make, i, t: make.scan(t, [1.0], f"laser{i % 2}"))


REFUSED = [
    (in_turn, {}, "/scan: got scans in 2 frames (laser0, laser1), expected those of one laser"),
    (unplaced, BOTH, "a further laser's frame rear is not fixed to base_link; frames: base_link"),
    (LASERS, {}, "2 laser scan topics, --scan-topic picks one: /front (12), /rear (12)"),
    (drive, {"scan_topic": "/odom"}, "no laser scans on /odom; there are: /scan (12)"),
    (lambda make: [("/chat", 1.0, make.string("hi"))], {}, "no laser scans; expected sensor_msgs/"),
    (lambda make: [("/chat", 1.0, make.string("hi"))], {}, "/chat (std_msgs/msg/String, 1)"),
    (two_odometries, {}, "2 odometry topics, --odom picks one (or none): /odom (12), /wheels (12)"),
    (two_odometries, {"odom": "/air"}, "'/air' is no topic and no frame above base_link"),
    (drive, {"imu": "/gyro"}, "--imu: no IMU messages on /gyro; there are: /imu (12)"),
    (tree(*CHAIN), {"base_frame": "map"}, "--base-frame: map is not fixed to the laser's frame"),
    (tree(*NO_NAMES), {}, "is below 2 frames, --base-frame picks one: b, a"),
    (tree(("base_link", "laser", (1e6, 0, 0), 0.0, 0.0)), {}, "mount: got (1000000.0"),
    (
        lambda make: [("/scan", 1e10 + t, make.scan(0.0, [1.0])) for t in T],
        {},
        "as great as 1.16e+10",
    ),
]


@pytest.mark.parametrize(("messages", "choices", "sentence"), REFUSED)
def test_what_cannot_be_chosen_is_refused(messages, choices, sentence, tmp_path):
    assert sentence in refused(bags.write(tmp_path, "mcap", messages), **choices)


@pytest.mark.parametrize(("kind", "old"), [("bag", True), ("bag", False), ("mcap", False)])
def test_odometry_and_mount_from_moving_transforms(kind, old, tmp_path):
    moving = (
        rests("map", "odom", (5.0, 0.0, 0.0), 0.0, 0.0),
        moves("/odom" if old else "odom", "base_link"),
        rests(*MOUNT),
    )
    path = bags.write(tmp_path, kind, tree(moving=moving, old=old))
    log = slams.load(path)
    assert log.odometry_at_scans() == pytest.approx(WAY, abs=1e-6)
    assert log.meta["source"]["odometry"] == "tf odom"
    assert log.laser.mount == pytest.approx((0.2, -0.1, 0.5))
    assert slams.load(path, truth="map").truth_at(T)[1:, 0] == pytest.approx(WAY[1:, 0] + 5.0)


def test_odometry_of_another_frame_is_carried_to_the_base(tmp_path):
    edge = fixed(("base_link", "wheels", (-0.5, 0, 0), 0.0, 0.0))
    wheels = each("/w", lambda make, _, t: make.odometry(t, 0.0, 0.0, 0.1, "wheels"))
    path = bags.write(tmp_path, "mcap", together(drive, edge, wheels))
    log = slams.load(path, odom="/w", base_frame="base_link")
    expected = Pose2(0.0, 0.0, 0.1) @ Pose2(0.5, 0.0, 0.0)
    assert log.odometry_at_scans()[3] == pytest.approx(expected)
    log = slams.load(path, odom="/w")  # whose frame is the base
    assert log.meta["source"]["base_frame"] == "wheels"
    assert log.laser.mount == pytest.approx((0.7, -0.1, 0.5))


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("roll", [0.0, math.pi])
def test_a_point_stays_where_it_is_however_the_laser_hangs(reverse, roll, tmp_path):
    point, place, yaw = np.array([3.0, 1.0]), np.array([0.2, -0.1]), 0.5
    seen = Pose2(*place, yaw).inverse().transform(point[None])[0]
    if roll:
        seen[1] = -seen[1]  # in a frame whose y points the other way
    direction, distance = math.atan2(seen[1], seen[0]), float(np.hypot(*seen))
    step = -0.05 if reverse else 0.05
    row = np.full(41, np.inf)
    row[7] = distance
    angles = (direction - 7 * step, step)
    mount = fixed(("base_link", "laser", (*place, 0.3), yaw, roll))
    scans = each("/scan", lambda make, _, t: make.scan(t, row, angles=angles))
    log = slams.load(bags.write(tmp_path, "bag", together(scans, mount)))
    hit = log.laser.directions[7] * log.ranges[0, 7]
    assert log.laser.mount.transform(hit[None])[0] == pytest.approx(point, abs=1e-5)
    assert log.notes == ()


@pytest.mark.parametrize(("roll", "sign"), [(0.0, 1.0), (math.pi, -1.0)])
def test_the_gyro_turns_about_the_upright_axis(roll, sign, tmp_path):
    gyro = ("base_link", "imu", (0.0, 0.0, 0.1), 0.3, roll)
    rates = each("/imu", lambda make, i, t: make.imu(t, (0.0, 0.0, 0.4 + i)))
    log = slams.load(bags.write(tmp_path, "mcap", together(tree(MOUNT, gyro), rates)))
    assert log.yaw_rate.values == pytest.approx(sign * (0.4 + np.arange(N)))


@pytest.mark.parametrize("kind", ["bag", "mcap", "db3"])
def test_an_orientation_is_the_attitude_of_the_base(kind, tmp_path):
    """The IMU looks backward, so that what rolls it to the left rolls the base to the right."""
    gyro = ("base_link", "imu", (0.0, 0.0, 0.1), math.pi, 0.0)
    rolls = each("/imu", lambda make, i, t: make.imu(t, (0.0,) * 3, roll=0.01 * i))
    log = slams.load(bags.write(tmp_path, kind, together(tree(MOUNT, gyro), rolls)))
    assert log.attitude.values[:, 0] == pytest.approx(-0.01 * np.arange(N), abs=1e-9)
    assert log.attitude.values[:, 1] == pytest.approx(np.zeros(N), abs=1e-9)
    assert log.laser.mount_z == pytest.approx(MOUNT[2][2])


def test_a_gyro_that_gives_no_rates_is_left_out(tmp_path):
    bare = each("/imu", lambda make, _, t: make.imu(t, (0, 0, 0), given=False))
    path = bags.write(tmp_path, "mcap", together(tree(MOUNT), bare))
    assert slams.load(path).yaw_rate is None


def test_changing_beams_are_brought_to_the_most_common(tmp_path):
    angles = np.linspace(-math.pi, math.pi, 360, endpoint=False)
    distance = 5.0 + np.cos(angles)

    def scan(make, i, t):
        n, first = (350, 0.0) if i % 4 == 3 else (360, -math.pi)
        step = 2.0 * math.pi / n
        return make.scan(t, 5.0 + np.cos(first + step * np.arange(n)), angles=(first, step))

    log = slams.load(bags.write(tmp_path, "bag", each("/scan", scan)))
    assert log.ranges.shape == (N, 360)
    assert "3 of 12 scans have other beams and are resampled to the most common 360" in log.notes
    assert log.ranges[0] == pytest.approx(distance, abs=1e-5)
    assert log.ranges[3] == pytest.approx(distance, abs=0.02)  # at most half a degree off


def test_other_beams_give_the_nearest_reading_and_none_where_there_is_none(tmp_path):
    row = np.arange(1.0, 11.0)

    def scan(make, i, t):
        shifted = i == N - 1
        return make.scan(t, row[:8] if shifted else row, angles=(-0.26 if shifted else -0.5, 0.1))

    last = slams.load(bags.write(tmp_path, "bag", each("/scan", scan))).ranges[-1]
    assert np.isnan(last[:2]).all()  # -0.26 is nearest to -0.3
    assert last[2:].tolist() == row[:8].tolist()


def test_drivers_that_measure_each_sweep_are_deskewed_by_the_median(tmp_path):
    def scan(make, i, t):
        return make.scan(t, ranges()[i], beam=1e-3 + 1e-5 * i if i else 0.1)

    log = slams.load(bags.write(tmp_path, "mcap", each("/scan", scan)))
    assert log.laser.time_increment == pytest.approx(1.06e-3)


def test_the_first_echo_counts_and_none_is_nothing_seen(tmp_path):
    echoes = each("/echoes", lambda make, _, t: make.echoes(t, [[2.0, 3.0], [], [4.0]]))
    log = slams.load(bags.write(tmp_path, "mcap", echoes))
    assert log.ranges[0].tolist() == [2.0, math.inf, 4.0]


def scans(**more):
    return each("/scan", lambda make, _, t: make.scan(t, [1.0] * 31, **more))


first_empty = each("/scan", lambda make, i, t: make.scan(t, [1.0] * 3 if i else []))


@pytest.mark.parametrize(
    ("messages", "note"),
    [
        (scans_on("/scan"), "no transform from a base to the laser's frame 'laser'"),
        (tree((*MOUNT[:4], math.radians(30.0))), "the laser is tilted by 30 degrees"),
        (tree(MOUNT, ("odom", "base_link", (0, 0, 0), 0.0, 0.0)), "odom does not move and is no"),
        (each("/scan", lambda make, *_: make.scan(0.0, [1.0])), "the times of recording"),
        (scans(beam=0.1), "does not fit a scan every 0.1 s; scans are taken as instantaneous"),
        (scans(limits=(0.1, 0.0)), "range_max is 0; 1.00 m is used instead"),
        (scans(limits=(0.1, 1e9)), "is used instead"),
        (scans(limits=(0.1, math.inf)), "is used instead"),
        (first_empty, "1 scans without beams or angles are left out"),
    ],
)
def test_what_is_assumed_is_said(messages, note, tmp_path):
    log = slams.load(bags.write(tmp_path, "bag", messages))
    assert note in " ".join(log.notes)
    assert log.t == pytest.approx(T[-len(log) :], abs=1e-6) and N - 1 <= len(log) <= N
    assert log.laser.time_increment == 0.0 and log.odom is None


def long_drive(make):
    row, t = ranges(1, 500)[0], 1e9 + 0.1 * np.arange(300)
    return [("/scan", one, make.scan(one, row, angles=(-1.5, 0.01))) for one in t]


DAMAGE = {"bag": "rosbag reindex", "mcap": "mcap recover", "db3": ".recover"}


@pytest.mark.parametrize("kind", bags.KINDS[:5])
def test_a_bag_cut_short_is_refused_or_salvaged(kind, tmp_path, capsys):
    path = bags.write(tmp_path, kind, long_drive)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(0.6 * len(whole))])
    out = tmp_path / "out.npz"
    assert convert.main([str(path), str(out)]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert err.startswith(f"slams convert: {path}: cut short or damaged (")
    assert DAMAGE[kind.partition("-")[0]] in err
    assert err.endswith("--salvage reads the undamaged part\n")
    assert not out.exists()
    assert convert.main([str(path), str(out), "--salvage"]) == 0
    assert "note: cut short or damaged" in capsys.readouterr().err
    log = slams.load(out)
    assert 60 < len(log) < 240
    assert np.array_equal(log.ranges[-1], ranges(1, 500)[0])


def test_of_a_chunk_cut_short_the_beginning_is_read(tmp_path):
    path = bags.write(tmp_path, "bag", scans_on("/scan"))
    data = path.read_bytes()
    path.write_bytes(ranges()[0].tobytes().join(data.split(ranges()[0].tobytes())[:8]))
    log = slams.load(path, salvage=True)
    assert len(log) == 7  # the only chunk ends within the eighth
    assert "cannot be read" not in " ".join(log.notes)


def test_salvaged_messages_are_in_the_order_of_receiving(tmp_path):
    path = bags.write(tmp_path, "bag", lambda make: scans_on("/scan")(make)[::-1])
    data = path.read_bytes()
    path.write_bytes(data[: data.rfind(b"op=\x07")])
    assert (np.diff(slams.load(path, salvage=True).t) > 0).all()


@pytest.mark.parametrize("kind", ["folder-db3", "folder-mcap", "folder-zstd"])
def test_a_folder_without_metadata(kind, tmp_path):
    path = bags.write(tmp_path, kind, drive)
    (path / "metadata.yaml").unlink()
    assert "ros2 bag reindex" in refused(path)
    assert np.array_equal(slams.load(path, salvage=True).ranges, ranges())


@pytest.mark.parametrize("kind", bags.KINDS[:5])
def test_the_linear_reader_finds_all_that_the_library_finds(kind, tmp_path):
    path = bags.write(tmp_path, kind, drive)
    names = ["/scan", "/odom", "/imu", "/tf_static"]
    found = salvaged(path, kind.partition("-")[0])
    with open_bag(path, kind.partition("-")[0]) as bag:
        assert sorted(found.topics) == sorted(bag.topics)
        assert sorted(found.records(names)) == sorted(bag.records(names))


def test_a_message_that_cannot_be_read(tmp_path):
    path = bags.write(tmp_path, "bag", drive)
    data = bytearray(path.read_bytes())
    at = data.find(np.float32(30.0).tobytes())  # range_max, then the number of ranges
    data[at + 4 : at + 8] = (10**6).to_bytes(4, "little")
    path.write_bytes(data)
    assert "a message of /scan cannot be read; --salvage leaves it out" in refused(path)
    log = slams.load(path, salvage=True)
    assert len(log) == N - 1
    assert "1 messages cannot be read and are left out" in log.notes


def test_an_mcap_with_messages_of_others_too_is_salvaged(tmp_path):
    path = bags.write(tmp_path, "mcap", drive)
    name = b"std_msgs/msg/String"
    data = path.read_bytes()
    foreign = data.replace(name + b"\x07\0\0\0ros2msg", name + b"\x07\0\0\0ros1msg")
    assert foreign != data
    path.write_bytes(foreign)
    assert "('ros1msg'); 'mcap recover" in refused(path)
    assert np.array_equal(slams.load(path, salvage=True).ranges, ranges())


@pytest.mark.parametrize(
    ("content", "command"),
    [
        (gzip.compress(b"#ROSBAG V2.0\n"), "unpack it first: gunzip x"),
        (bz2.compress(b"#ROSBAG V2.0\n"), "unpack it first: bunzip2 x"),
        (b"\x28\xb5\x2f\xfd123", "unpack it first: zstd -d x"),
        (b"#ROSBAG V1.2\n", "'rosbag fix' makes a new one"),
    ],
    ids=["gzip", "bzip2", "zstd", "version 1.2"],  # packed bytes hold the time of day
)
def test_packed_and_old_bags_are_refused_with_the_way_out(content, command, tmp_path):
    (tmp_path / "x").write_bytes(content)
    assert refused(tmp_path / "x").endswith(command)
    assert "is a directory without a ROS 2 bag" in refused(tmp_path)


def test_a_topic_without_a_name_is_none(tmp_path):
    nameless = each("", lambda make, _, t: make.odometry(t, 0, 0, 0))
    path = bags.write(tmp_path, "bag", together(scans_on("/scan"), nameless))
    # which the library cannot read
    assert slams.load(path, salvage=True).odom is None


def test_a_database_that_cannot_even_say_what_is_wrong(tmp_path):
    path = bags.write(tmp_path, "db3", drive).rename(tmp_path / "killed.db3")
    path.write_bytes(path.read_bytes().replace(b"CREATE TABLE", b"CREATE\x9bTABLE"))
    sentence = refused(path)
    assert "damaged (Cannot open database killed.db3: " in sentence
    assert "nothing in it can be salvaged" in refused(path, salvage=True)


def test_a_folder_that_may_not_be_read(tmp_path, monkeypatch):
    def forbidden(path):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(os, "listdir", forbidden)
    monkeypatch.setattr(os, "scandir", forbidden)
    with pytest.raises(PermissionError):
        slams.load(tmp_path)


def test_a_database_whose_recorder_was_killed(tmp_path):
    whole, killed = bags.write(tmp_path, "db3", drive), tmp_path / "killed.db3"
    database = sqlite3.connect(whole)
    database.execute("PRAGMA journal_mode=wal")
    rows = database.execute("SELECT topic_id, timestamp, data FROM messages").fetchall()
    database.execute("DELETE FROM messages WHERE timestamp > ?", (round(1e9 * T[5]),))
    database.commit()
    database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    late = [row for row in rows if row[1] > round(1e9 * T[5])]
    insert = "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)"
    database.executemany(insert, late)
    database.commit()
    shutil.copyfile(whole, killed)
    shutil.copyfile(f"{whole}-wal", f"{killed}-wal")
    database.close()
    assert len(slams.load(whole)) == N
    assert "(its last messages are still in killed.db3-wal); 'sqlite3" in refused(killed)
    assert len(slams.load(killed, salvage=True)) == N
    names = sorted(path.name for path in tmp_path.glob("killed*"))
    assert names == ["killed.db3", "killed.db3-wal"]


def test_a_folder_whose_recording_never_began(tmp_path):
    folder = tmp_path / "drive"
    folder.mkdir()
    (folder / "drive_0.mcap").touch()
    assert "ros2 bag reindex" in refused(folder)
    assert "nothing in it can be salvaged" in refused(folder, salvage=True)


def test_the_bag_of_a_hand_held_laser(shared_data):
    log = slams.load(shared_data("data/handheld/scan_tools_demo.bag"))
    assert (len(log), log.laser.n_beams) == (360, 681)
    assert log.scan_period == pytest.approx(0.1, abs=1e-3)
    assert log.laser.time_increment == pytest.approx(0.1 / 1024, rel=1e-6)
    assert log.odom is None
