"""Maps at their own pace, and the node with an algorithm that closes loops."""

import threading

import numpy as np
import pytest

from slams import metrics
from slams.live.__main__ import write_results
from slams.ros.messages import MAP_TYPE, seconds
from slams.run import write_drive
from slams.types import Pose2
from tests.rooms import drive, driven
from tests.slams.live.commands import PATIENCE
from tests.slams.live.robots import Stand, close, mounted, planar
from tests.slams.loops.test_looped import around


def test_a_map_is_published_at_its_pace_and_at_the_end_if_there_was_a_scan_since(monkeypatch):
    def stamps(stand):
        return [message.header.stamp.sec for message in stand.bus.sent("/map")]

    stand, seen = mounted(monkeypatch, map_every=0.01), threading.Semaphore(0)
    stand.bus.callbacks["/map"] = [(MAP_TYPE, lambda record: seen.release())]
    for t in (5.0, 6.0):
        stand.start_and_drive(t)
        assert seen.acquire(timeout=PATIENCE)
    assert not seen.acquire(timeout=0.1)
    stand.node.close()
    assert stamps(stand) == [5, 6]
    stand = mounted(monkeypatch, map_every=3600.0)
    stand.start_and_drive(7.0)
    stand.node.close()
    assert stamps(stand) == [7]


@pytest.mark.parametrize(("every", "n_notes"), [(3600.0, 1), (0.0, 0)])
def test_a_map_that_cannot_be_sent_is_reported_and_none_drawn_unasked(every, n_notes, monkeypatch):
    def refuse(stamp, grid):
        raise OSError("no network")

    stand = mounted(monkeypatch, map_every=every)
    stand.node._publisher.publish_map = refuse
    stand.start_and_drive(1.0)
    stand.node.close()
    stand.look()
    assert stand.notes.count("the map is not published: no network") == n_notes


@pytest.mark.parametrize("name", ["hector", "tsd", "crsm", "gmapping"])
def test_a_snapshot_is_not_touched_by_later_scans(name):
    scans = list(drive(n=20))
    slam = driven(name, scans[:10])
    before, draw = slam.map(), slam.snapshot()
    for scan in scans[10:]:
        slam.update(scan)
    drawn = draw()
    np.testing.assert_array_equal(drawn.p, before.p)
    assert (drawn.origin, drawn.resolution) == (before.origin, before.resolution)
    assert not np.array_equal(slam.map().p, before.p, equal_nan=True)


DRIFTING = "tests.wheels:Drifting+loops"


@pytest.fixture(scope="module")
def stand():
    """A node after two laps of a ring, its last map out."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        stand = Stand(monkeypatch, DRIFTING, map_every=3600.0)
        stand.play(around())
        stand.start_and_drive()
        stand.node.close()
    return stand


def test_a_closed_loop_corrects_map_to_odom(stand):
    edges = [tf.transforms[0] for tf in stand.bus.sent("/tf")]
    edges = [edge for edge in edges if edge.header.frame_id == "map"]
    assert {edge.child_frame_id for edge in edges} == {"odom"}
    poses = [planar(e.transform.translation, e.transform.rotation) for e in edges]
    moved = [a.between(b) for a, b in zip(poses[:-1], poses[1:], strict=True)]
    changes = sum(not close(step, (0.0, 0.0, 0.0)) for step in moved)
    assert changes == stand.node.report()["algorithm"]["redrawn"] >= 1  # wheels alone change none
    assert close(poses[-1] @ Pose2(*around().odom.values[-1]), stand.node.drive.poses[-1])


def test_the_path_so_far_is_published_with_the_map_as_corrected(stand):
    assert len(stand.bus.sent("/path")) == len(stand.bus.sent("/map"))
    log, drive = around(), stand.node.drive
    path = stand.bus.sent("/path")[-1].poses
    poses = np.array([planar(p.pose.position, p.pose.orientation) for p in path])
    stamps = np.array([seconds(p.header.stamp) for p in path])
    rows = np.searchsorted(drive.t, stamps - 1e-6)
    assert np.allclose(poses, stand.live.corrected()[rows], rtol=0.0, atol=1e-9)
    truth, before = log.truth_at(log.t)[rows], np.array(drive.poses)[rows]
    assert metrics.ate(poses, truth) < 0.3 * metrics.ate(before, truth)


def test_the_corrected_poses_are_among_the_results(stand, tmp_path):
    write_results(tmp_path / "out", "drifting+loops", stand.node)
    corrected = np.loadtxt(tmp_path / "out/trajectory_corrected.tum")[:, 1:3]
    assert np.allclose(corrected, stand.live.corrected()[:, :2], rtol=0.0, atol=1e-6)


def test_a_recording_has_the_corrected_poses(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr("slams.formats.mcap.write_mcap", lambda *given: written.append(given[2]))
    log, poses = drive(n=3), np.zeros((3, 3))
    write_drive(tmp_path / "o", driven("hector", log).map(), (log.t, poses, poses + 1.0), {}, log)
    np.testing.assert_array_equal(written[0], poses + 1.0)
