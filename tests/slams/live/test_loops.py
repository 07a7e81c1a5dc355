"""The node with an algorithm that closes loops: the correction, the map and the path go out."""

import numpy as np
import pytest

from slams import metrics
from slams.formats.frames import yaw_of
from slams.live.__main__ import write_results
from slams.ros.stamps import seconds
from slams.types import Pose2
from tests.slams.live.robots import Stand, close
from tests.slams.loops.test_looped import around

DRIFTING = "tests.wheels:Drifting+loops"


def planar(where, rotation):
    return Pose2(where.x, where.y, yaw_of(rotation))


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


def test_the_path_so_far_is_published_as_corrected(stand):
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


def test_without_loops_no_path_is_published(monkeypatch):
    stand = Stand(monkeypatch, "hector", map_every=3600.0)
    stand.play(around().select(30))
    stand.start_and_drive()
    stand.node.close()
    assert stand.bus.sent("/map")
    assert not stand.bus.sent("/path")
