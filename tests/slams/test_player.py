"""The loop over a log: what counts as time, what is no pose."""

import numpy as np
import pytest

from slams import player
from slams.registry import create
from slams.types import Pose2


def test_the_time_of_who_watches_is_not_counted(room_log, monkeypatch):
    """By a clock that goes on only while somebody watches."""
    seen = []
    monkeypatch.setattr(player.time, "process_time", lambda: float(len(seen)))
    done = player.replay(create("odometry"), room_log, lambda scan, pose: seen.append(scan))
    assert len(seen) == len(room_log)
    assert not done.seconds.any()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_pose_that_is_not_finite_is_refused_with_its_scan(bad, room_log, monkeypatch):
    slam = create("odometry")
    poses = iter([Pose2(0.0, 0.0, 0.0)] * 3 + [Pose2(bad, 0.0, 0.0)] * len(room_log))
    monkeypatch.setattr(slam, "update", lambda scan: next(poses))
    with pytest.raises(RuntimeError, match=r"Odometry returned Pose2\(x=(nan|inf).* for scan 3"):
        player.replay(slam, room_log)
