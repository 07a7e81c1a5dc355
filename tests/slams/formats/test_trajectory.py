"""Trajectories that other programs wrote: files, topics and frames, read by one function."""

import gzip
import math

import numpy as np
import pytest

import slams
from slams.formats import mcap, trajectory
from slams.formats.options import SourceOptions
from slams.formats.trajectory import read_trajectory
from slams.types import IDENTITY, Pose2
from tests import bags
from tests.rooms import drive

N = 20
T = 1.6e9 + 0.1 * np.arange(N)
WAY = np.stack([0.1 * np.arange(N), 0.02 * np.arange(N), 0.3 * np.arange(N)], axis=1)
WAY[:, 2] = (WAY[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
MOUNT = ("base_link", "laser", (0.2, -0.1, 0.3), 0.5, 0.0)


def same(track, t=T, poses=WAY, tolerance=1e-6):
    assert track.t == pytest.approx(np.asarray(t), abs=1e-6)
    error = track.values - poses
    error[:, 2] = (error[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
    assert np.abs(error).max() < tolerance


def refused(spec, log=None, error=ValueError, **options):
    with pytest.raises(error) as caught:
        read_trajectory(spec, log, SourceOptions(**options))
    assert "\n" not in str(caught.value)
    return str(caught.value)


def rows(*stamps):
    return "".join(f"{t} 0 0 0 0 0 0 1\n" for t in stamps)


@pytest.mark.parametrize("packed", [False, True])
def test_what_we_write_reads_back(packed, tmp_path):
    path = tmp_path / "run"
    trajectory.write_tum(path, T, WAY)
    if packed:
        path.write_bytes(gzip.compress(path.read_bytes()))
    same(read_trajectory(path))
    same(read_trajectory(str(path)))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "got no poses, expected a trajectory"),
        ("# t, x, y\n", "got no poses"),
        ("1 2 3\n", "got 3 columns, expected t x y z qx qy qz qw"),
        ("1 2 3 4 5 6 7 8\n1 2 3\n", "not lines of t x y z qx qy qz qw"),
        ("1,2,3,4\n", "not lines of t x y z qx qy qz qw"),
        ("1 2 3 4 5 6 7 eight\n", "not lines of t x y z qx qy qz qw"),
        ("1 2 3 0 0 0 0 1\n" * 3, "got 3 poses at one stamp (1 s), expected a trajectory"),
        ("1 2 3 0 0 0 0 1\n2 nan 3 0 0 0 0 1\n", "1 of 2 poses are not finite or no rotation"),
        ("1 2 3 0 0 0 0 1\n2 2 3 0 0 0 0 0\n", "1 of 2 poses are not finite or no rotation"),
        ("inf 2 3 0 0 0 0 1\n2 2 3 0 0 0 0 1\n", "1 of 2 poses are not finite"),
        (rows(3, 2, 1), "2 of 3 stamps are earlier than the stamp before them"),
        (rows(1, 2, 3, 4, 5, 6, 8, 7), "1 of 8 stamps are earlier"),
    ],
)
def test_a_file_that_is_no_trajectory(text, sentence, tmp_path):
    (tmp_path / "run.txt").write_text(text)
    assert refused(tmp_path / "run.txt").startswith(f"{tmp_path / 'run.txt'}: {sentence}")


def test_the_heading_of_a_robot_that_rolls(tmp_path):
    q = bags.Make(bags.ROS2).quaternion(yaw=0.5, roll=0.3)
    (tmp_path / "run.tum").write_text(f"1 2 3 0 {q.x} {q.y} {q.z} {q.w}\n")
    assert trajectory.read(tmp_path / "run.tum")[1] == pytest.approx(np.array([[2.0, 3.0, 0.5]]))


def test_stamps_are_put_in_order_and_of_equal_ones_the_first_counts(tmp_path):
    t = np.array([*np.arange(20.0), 18.5, 3.0])
    poses = np.column_stack([np.arange(22.0), np.zeros(22), np.zeros(22)])
    trajectory.write_tum(tmp_path / "run.tum", t, poses)
    read = read_trajectory(tmp_path / "run.tum")
    assert read.t.tolist() == [*range(19), 18.5, 19.0]
    assert read.values[[3, 19, 20], 0].tolist() == [3.0, 20.0, 19.0]


def test_files_that_are_no_text(tmp_path):
    drive(n=3).save(tmp_path / "log.npz")
    assert "got an npz file, expected a trajectory: TUM or a bag" in refused(tmp_path / "log.npz")
    (tmp_path / "run.zst").write_bytes(b"\x28\xb5\x2f\xfd123")
    assert refused(tmp_path / "run.zst").endswith("unpack it first: zstd -d run.zst")
    (tmp_path / "cut.gz").write_bytes(gzip.compress(b"1 2 3 0 0 0 0 1\n")[:-9])
    assert "packed data end too early; copy it again" in refused(tmp_path / "cut.gz")


def test_our_own_result(tmp_path):
    log = drive(n=N)
    grid = slams.OccupancyGrid(np.zeros((2, 2), np.float32), 0.05, (0.0, 0.0))
    path = tmp_path / "result.mcap"
    mcap.write_mcap(path, log, WAY, grid)
    same(read_trajectory(path), log.t)
    same(slams.load(path, truth=str(path)).truth, log.t)
    path.write_bytes(path.read_bytes().replace(b"/pose", b"/pise"))
    assert f"{path}: '/pose' is no topic, frame or file; topics: " in refused(path)


def recorded(make):
    """Scans, and what SLAM programs say: poses on topics, and map -> odom -> base_link by tf.

    /fused has the poses of a frame behind the base. map -> odom has stamps of its own, from the
    third scan to the last but one.
    """
    wheels = ("base_link", "wheels", (-0.5, 0.0, 0.0), 0.0, 0.0)
    messages = [("/tf_static", T[0], make.tf(T[0], MOUNT, wheels))]
    rows = [(t, *pose) for t, pose in zip(T, WAY, strict=True)]
    for k, row in enumerate(rows):
        behind = Pose2(*WAY[k]) @ Pose2(-0.5, 0.0, 0.0)
        messages += [
            ("/scan", T[k] + 0.03, make.scan(T[k], np.ones(5))),
            ("/slam_pose", T[k] + 0.05, make.posed(*row)),
            ("/amcl", T[k] + 0.05, make.posed_with_covariance(*row)),
            ("/fused", T[k] + 0.05, make.odometry(T[k], *behind, child="wheels", frame="map")),
            ("/path", T[k] + 0.05, make.path(T[k], rows[: k + 1])),
            ("/tf", T[k] + 0.01, transform(make, T[k], "odom", "base_link", odom(k))),
        ]
    corrections = np.linspace(T[2], T[-2], 7)
    return messages + [("/tf", t, transform(make, t, "map", "odom", shift(t))) for t in corrections]


def transform(make, t, parent, child, pose):
    return make.tf(t, (parent, child, (pose.x, pose.y, 0.0), pose.theta, 0.0))


def shift(t):
    """The odom frame in the map: it drifts steadily, without turning."""
    return Pose2(1.0 + 0.5 * (t - T[0]), -2.0, 0.7)


def odom(k):
    """The base in the odom frame, such that it is at WAY in the map."""
    return shift(T[k]).inverse() @ Pose2(*WAY[k])


@pytest.fixture(scope="module", params=["bag", "mcap"])
def bag(request, tmp_path_factory):
    return bags.write(tmp_path_factory.mktemp("bags"), request.param, recorded)


TF = SourceOptions(odom="odom")  # for /fused is odometry, too


@pytest.mark.parametrize("topic", ["/slam_pose", "slam_pose", "/amcl", "/fused", "/path"])
def test_topics_of_every_type(topic, bag):
    same(read_trajectory(topic, bag, TF))


@pytest.mark.parametrize("frame", ["map", "/map"])
def test_a_frame_is_composed_as_tf_would_and_not_extrapolated(frame, bag):
    read = read_trajectory(frame, bag, TF)
    same(read, T[2:-1], WAY[2:-1])


def test_poses_are_of_the_base_that_the_log_has(bag):
    base = SourceOptions(odom="odom", base_frame="wheels")
    behind = [Pose2(*pose) @ Pose2(-0.5, 0.0, 0.0) for pose in WAY]
    same(read_trajectory("/fused", bag, base), poses=behind)
    same(read_trajectory("map", bag, base), T[2:-1], behind[2:-1])


def test_a_transform_sent_again_and_again_is_not_the_quickest(tmp_path):
    def messages(make):
        every = [("/tf_static", T[0], make.tf(T[0], MOUNT))]
        for k, t in enumerate(T):
            every.append(("/scan", t, make.scan(t, np.ones(5))))
            every.append(("/tf", t, transform(make, t, "odom", "base_link", odom(k))))
            sent = T[k - k % 10] if k < N - 1 else t  # two stamps that differ, five times each
            every += [("/tf", t, transform(make, sent, "map", "odom", shift(sent)))] * 3
            every += [("/tf", t, transform(make, s, "top", "map", IDENTITY)) for s in (t, t + 0.03)]
        return every

    same(read_trajectory("top", bags.write(tmp_path, "mcap", messages)))


def test_of_a_path_the_last_message_counts_and_it_needs_stamps(tmp_path):
    def messages(make):
        rows = [(t, *pose) for t, pose in zip(T, WAY, strict=True)]
        no_stamps = [(0.0, *row[1:]) for row in rows]
        return [
            ("/scan", T[0], make.scan(T[0], np.ones(5))),
            ("/path", T[0], make.path(T[0], rows)),
            ("/path", T[1], make.path(T[1], [(t, 9.0, *more) for t, _, *more in rows[:7]])),
            ("/bare", T[0], make.path(T[0], no_stamps)),
            ("/cleared", T[0], make.path(T[0], rows)),
            ("/cleared", T[1], make.path(T[1], [])),
        ]

    path = bags.write(tmp_path, "bag", messages)
    read = read_trajectory("/path", path)
    assert (len(read.t), set(read.values[:, 0])) == (7, {9.0})
    assert f"{path}: /bare: got 20 poses at one stamp" in refused("/bare", path)
    assert f"{path}: /cleared: there are no poses" in refused("/cleared", path)


def test_broken_poses_are_refused_not_left_out(tmp_path):
    def messages(make):
        xs = [*WAY[:-1, 0], math.nan]
        poses = [("/p", t, make.posed(t, x, 0.0, 0.0)) for t, x in zip(T, xs, strict=True)]
        return [("/scan", T[0], make.scan(T[0], np.ones(5))), *poses]

    path = bags.write(tmp_path, "mcap", messages)
    assert refused("/p", path) == f"{path}: /p: 1 poses are not finite; expected a trajectory"


def test_what_is_not_there_is_told_with_what_is(bag, tmp_path):
    topics = "topics: /slam_pose (20), /amcl (20), /fused (20), /path (20)"
    frames = "frames: base_link, laser, map, odom, wheels"
    sentence = f"{bag}: 'nowhere' is no topic, frame or file; {topics}; {frames}"
    assert refused("nowhere", bag, odom="odom") == sentence
    assert "none: there are no poses" in refused("none", bag, odom="odom")
    sentence = "'laser' is no topic and no frame above base_link; such frames: odom, map"
    assert sentence in refused("laser", bag, odom="odom")


def test_names_without_a_bag(tmp_path):
    none = "nowhere: no such file; without a bag there are no topics and frames"
    assert refused("nowhere", error=FileNotFoundError) == none
    drive(n=3).save(tmp_path / "log.npz")
    said = refused("/pose", tmp_path / "log.npz", error=FileNotFoundError)
    assert said == f"/pose: no such file; {tmp_path}/log.npz is no bag, it has no topics and frames"
    assert ": a directory without a bag;" in refused(tmp_path, error=FileNotFoundError)


def test_a_file_goes_before_a_topic_and_a_slash_makes_it_the_topic(bag, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    trajectory.write_tum("slam_pose", T, WAY + 1.0)
    trajectory.write_tum("map", T, WAY + 1.0)
    same(read_trajectory("slam_pose", bag), poses=WAY + 1.0)
    same(slams.load(bag, truth="map", odom="odom").truth, poses=WAY + 1.0)
    same(read_trajectory("/slam_pose", bag, TF))
    same(read_trajectory("/map", bag, TF), T[2:-1], WAY[2:-1])


def test_a_damaged_bag_is_refused_or_salvaged(tmp_path):
    path = bags.write(tmp_path, "mcap", recorded)
    path.write_bytes(path.read_bytes()[:-60])
    assert "--salvage reads the undamaged part" in refused("/amcl", path)
    same(read_trajectory("/amcl", path, SourceOptions(odom="odom", salvage=True)))
